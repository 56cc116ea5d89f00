#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "idl/endpoint.h"
#include "storage/models/models.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {

inline void StoreLinearModels(const std::filesystem::path& data) {
  storage::ModelStore store(data / "models.db",
                            storage::Access::kOccasionalWriter);
  store.Save(LinearModels(), storage::Activation::kAlways);
}

/// @returns whether the condition came true before the patience ended.
inline bool Await(
    const std::function<bool()>& condition,
    std::chrono::milliseconds patience = std::chrono::milliseconds(30'000)) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

/// Valves V0, V1, ... that several monitors share, published in a thread of
/// their own. All of them fail and recover together.
class SharedPlant {
 public:
  SharedPlant(const idl::DdsOptions& dds, int valves,
              std::chrono::milliseconds period)
      : valves_(valves),
        period_(period),
        participant_(dds),
        samples_(participant_, {idl::Profile::kLive, valves}),
        sends_([this](const std::stop_token& stop) { Send(stop); }) {}

  void SetFaulty(bool on) { offset_ = on ? kF7Offset : 0.0; }

 private:
  void Send(const std::stop_token& stop) {
    auto due = std::chrono::steady_clock::now();
    for (std::uint64_t k = 0; !stop.stop_requested(); ++k) {
      for (int v = 0; v < valves_; ++v) {
        samples_.Write({"V" + std::to_string(v), PlantSample(k, offset_)});
      }
      due += period_;
      std::this_thread::sleep_until(due);
    }
  }

  const int valves_;
  const std::chrono::milliseconds period_;
  std::atomic<double> offset_{0.0};
  idl::Participant participant_;
  idl::Publisher<idl::ValveSampleMessage> samples_;
  std::jthread sends_;
};

}  // namespace fdi::monitor
