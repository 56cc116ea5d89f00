#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "idl/endpoint.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {

inline std::string ValveName(int index) {
  return "V" + std::to_string(index);
}

/// Half of the time faulty, each valve in its own rhythm of 200 to 400 samples.
inline double OffsetOf(int valve, std::uint64_t k) {
  const auto v = static_cast<std::uint64_t>(valve);
  const std::uint64_t cycle = 200 + v % 201;
  return (k + 37 * v) % cycle < cycle / 2 ? 0.0 : kF7Offset;
}

/// Publishes the valves at 5 000 samples a second or 100 instants, whichever is
/// less.
class FaultyPlant {
 public:
  static constexpr int kMaxValves = 1000;

  explicit FaultyPlant(idl::Participant& participant)
      : samples_(participant,
                 idl::PublisherOptions{idl::Profile::kLive, kMaxValves}),
        thread_([this](const std::stop_token& stop) { Run(stop); }) {}

  void SetValves(int count) { valves_ = count; }
  /// The next instant of all valves.
  std::uint64_t next() const { return next_; }
  void EndStreams() {
    thread_.request_stop();
    thread_.join();
    for (int v = 0; v < kMaxValves; ++v) {
      samples_.Dispose({ValveName(v), {}});
    }
  }

 private:
  void Run(const std::stop_token& stop) {
    std::chrono::steady_clock::time_point due =
        std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      const int count = valves_;
      for (int v = 0; v < count; ++v) {
        samples_.Write({ValveName(v), PlantSample(next_, OffsetOf(v, next_))});
      }
      ++next_;
      due = std::max(
          due + std::chrono::milliseconds(std::max(10, count / 5)),
          std::chrono::steady_clock::now() - std::chrono::milliseconds(20));
      std::this_thread::sleep_until(due);
    }
  }

  idl::Publisher<idl::ValveSampleMessage> samples_;
  std::atomic<int> valves_{20};
  std::atomic<std::uint64_t> next_{0};
  std::jthread thread_;
};

}  // namespace fdi::monitor
