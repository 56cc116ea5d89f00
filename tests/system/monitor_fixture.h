#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "idl/endpoint.h"
#include "storage/models/models.h"
#include "tests/idl/test_domain.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/temporary_directory.h"
#include "tests/system/monitor_process.h"

namespace fdi::monitor {

inline constexpr std::chrono::seconds kMonitorPatience{30};

/// The built fdi-monitor as a process of its own, over DDS on loopback; the
/// test publishes the samples and reads the bus.
class MonitorFixture : public testing::Test {
 protected:
  MonitorFixture() {
    idl::DdsOptions dds;
    dds.domain = domain_.id();
    participant_.emplace(dds);
    samples_.emplace(*participant_,
                     idl::PublisherOptions{idl::Profile::kLossless, 100});
    decisions_.emplace(*participant_);
    events_.emplace(*participant_);
    status_.emplace(*participant_);
  }

  static std::filesystem::path StoreModels(const std::filesystem::path& data,
                                           const ModelSet& models) {
    storage::ModelStore store(data / "models.db",
                              storage::Access::kOccasionalWriter);
    store.Save(models, storage::Activation::kAlways);
    return data / "models.db";
  }

  std::vector<std::string> Command(
      const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{
        FDI_MONITOR_PROGRAM,          "--data",      data_.string(), "--domain",
        std::to_string(domain_.id()), "--transport", "udp",          "run",
        "--lossless-decisions"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return command;
  }

  /// Starts a monitor and waits until samples reach it and vectors us.
  std::unique_ptr<ChildProcess> StartMonitor(
      const std::vector<std::string>& arguments = {}) {
    auto monitor = std::make_unique<ChildProcess>(Command(arguments));
    // One that was stopped may still have a last word waiting here.
    speaker_ = ":" + std::to_string(monitor->pid());
    EXPECT_TRUE(monitor->AwaitLine("monitor_ready")) << monitor->errors();
    EXPECT_TRUE(samples_->WaitForReaders(1, kMonitorPatience));
    EXPECT_TRUE(decisions_->WaitForWriters(1, kMonitorPatience));
    EXPECT_TRUE(events_->WaitForWriters(1, kMonitorPatience));
    EXPECT_TRUE(status_->WaitForWriters(1, kMonitorPatience));
    // The writer may know of us later than we of it, and sends nothing before.
    counters_.clear();
    EXPECT_TRUE(
        Await([this] { return counters_["dds_decision_readers"] > 0; }));
    return monitor;
  }

  void Publish(const Sample& sample, const std::string& valve = "V1") {
    ASSERT_EQ(samples_->Write({valve, sample}, {}, kMonitorPatience),
              idl::WriteResult::kSent);
  }
  void Publish(std::uint64_t from, std::uint64_t to, double offset = 0.0) {
    for (std::uint64_t k = from; k < to; ++k) {
      Publish(PlantSample(k, offset));
    }
  }

  /// Takes what is on the bus until `condition` holds.
  template <typename Condition>
  bool Await(Condition condition) {
    const auto deadline = std::chrono::steady_clock::now() + kMonitorPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > deadline) {
        return false;
      }
      Take();
    }
    return true;
  }
  void TakeFor(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) {
      Take();
    }
  }
  bool AwaitEvent(TransitionKind kind) {
    return Await([this, kind] {
      return !faults_.empty() && faults_.back().transition.kind == kind;
    });
  }
  bool AwaitVectors(std::size_t count) {
    return Await([this, count] { return vectors_.size() >= count; });
  }

  void Take() {
    TakeVectors(std::chrono::milliseconds(10));
    events_->Take(
        {[this](const FaultEvent& m, const auto&) { faults_.push_back(m); },
         {}},
        std::chrono::milliseconds(0));
    status_->Take({[this](const idl::MonitorStatusMessage& m, const auto&) {
                     if (m.monitor.ends_with(speaker_)) {
                       counters_ = {m.counters.begin(), m.counters.end()};
                       health_ = m.health;
                     }
                   },
                   {}},
                  std::chrono::milliseconds(0));
  }

  void TakeVectors(std::chrono::milliseconds patience) {
    decisions_->Take(
        idl::ForEachVector([this](const idl::DecisionMessage& m, const auto&) {
          vectors_.push_back(m);
        }),
        patience);
  }

  const idl::TestDomain domain_;
  storage::TemporaryDirectory directory_;
  std::filesystem::path data_{directory_.path()};
  std::optional<idl::Participant> participant_;
  std::optional<idl::Publisher<idl::ValveSampleMessage>> samples_;
  std::optional<idl::Subscriber<idl::DecisionBatchMessage>> decisions_;
  std::optional<idl::Subscriber<FaultEvent>> events_;
  std::optional<idl::Subscriber<idl::MonitorStatusMessage>> status_;
  std::vector<idl::DecisionMessage> vectors_;
  std::vector<FaultEvent> faults_;
  std::string speaker_;  ///< End of the name of the monitor started last.
  std::map<std::string, std::uint64_t> counters_;
  idl::Health health_{idl::Health::kOk};
};

}  // namespace fdi::monitor
