// The built fdi-monitor while samples come as fast as DDS takes them.

#include <algorithm>
#include <atomic>
#include <cctype>
#include <csignal>
#include <iostream>
#include <sstream>
#include <stop_token>
#include <thread>

#include <gmock/gmock.h>

#include "storage/history/history_reader.h"
#include "storage/runs/runs.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using Clock = std::chrono::steady_clock;

class LoadTest : public MonitorFixture {
 protected:
  static constexpr std::uint64_t kValves = 50;

  LoadTest() { StoreModels(data_, LinearModels()); }

  /// Publishes sample by sample of all valves until all is out or a stop is
  /// requested; then published_ is how many of each.
  std::jthread PublishAll(std::uint64_t samples) {
    return std::jthread([this, samples](const std::stop_token& stop) {
      published_ = 0;
      while (published_ < samples && !stop.stop_requested()) {
        for (std::uint64_t v = 0; v < kValves; ++v) {
          samples_->Write({std::string("V").append(std::to_string(v)),
                           PlantSample(published_)});
        }
        ++published_;
      }
    });
  }

  /// As Command(), of a monitor that waits for no subscriber.
  std::vector<std::string> LiveCommand() const {
    std::vector<std::string> command = Command({"--record=lossless"});
    std::erase(command, "--lossless-decisions");
    return command;
  }

  /// Diagnoses and records 500 samples of each valve. @returns how long.
  std::chrono::duration<double> TimeOfARun(bool with_stuck_subscriber) {
    constexpr std::uint64_t kSamples = 500;
    counters_.clear();
    ChildProcess monitor(LiveCommand());
    EXPECT_TRUE(monitor.AwaitLine("monitor_ready")) << monitor.errors();
    std::optional<ChildProcess> watch;
    if (with_stuck_subscriber) {
      watch.emplace(std::vector<std::string>{
          FDI_MONITOR_PROGRAM, "--domain", std::to_string(domain_.id()),
          "--transport", "udp", "watch", "--totals"});
      EXPECT_TRUE(watch->AwaitLine("watch_ready")) << watch->errors();
      EXPECT_TRUE(Await([this] { return counters_.contains("received"); }));
      watch->Signal(SIGSTOP);
    }
    EXPECT_TRUE(samples_->WaitForReaders(1, kMonitorPatience));
    const Clock::time_point start = Clock::now();
    const std::jthread publisher = PublishAll(kSamples);
    EXPECT_TRUE(Await([this] {
      return counters_["diagnosed"] == kSamples * kValves &&
             counters_["recorded"] == kSamples * kValves;
    })) << counters_["diagnosed"]
        << " " << counters_["recorded"];
    const Clock::duration time = Clock::now() - start;
    EXPECT_EQ(counters_["decisions"], kSamples * kValves);
    EXPECT_EQ(counters_["record_dropped"], 0U);
    monitor.Signal(SIGTERM);
    EXPECT_EQ(monitor.AwaitExit(), 0) << monitor.errors();
    EXPECT_TRUE(samples_->WaitForReaders(0, kMonitorPatience));
    return time;
  }

  /// The counters of the line that a monitor writes at its end.
  static std::map<std::string, std::uint64_t> LastStatusLine(
      const std::string& log) {
    std::map<std::string, std::uint64_t> counters;
    const std::size_t begin = log.rfind("monitor_status health=");
    if (begin == std::string::npos) {
      return counters;
    }
    std::istringstream words(log.substr(begin, log.find('\n', begin) - begin));
    for (std::string word; words >> word;) {
      const std::size_t sign = word.find('=');
      if (sign != std::string::npos && std::isdigit(word[sign + 1]) != 0) {
        counters[word.substr(0, sign)] = std::stoull(word.substr(sign + 1));
      }
    }
    return counters;
  }

  std::uint64_t published_{0};  // of each valve
};

TEST_F(LoadTest, AStuckSubscriberDelaysNeitherDiagnosisNorRecording) {
  const std::chrono::duration<double> alone = TimeOfARun(false);
  ASSERT_TRUE(Await([this] {
    return decisions_->status().matched == 0 && samples_->matched() == 0;
  }));
  const std::chrono::duration<double> stuck = TimeOfARun(true);

  // The status that is waited for comes each second.
  EXPECT_LT(stuck.count(), 1.5 * alone.count() + 1.5) << alone.count();
}

// The publisher is a process of its own: Fast DDS 2.9.1 can deadlock in a
// writer that a reader leaves under load (eProsima/Fast-DDS pull request 5432).
TEST_F(LoadTest, ATermUnderFullLoadDrainsAndEnds) {
  const auto monitor = StartMonitor({"--record"});
  const ChildProcess publisher(
      {FDI_SIMULATOR_PROGRAM, "--domain", std::to_string(domain_.id()),
       "--transport", "udp", "--data", (directory_.path() / "sim").string(),
       "run", "--valve", "V", "--count", "200", "--duration", "100000",
       "--speed", "max"});
  ASSERT_TRUE(Await([this] { return counters_["diagnosed"] > 20'000; }))
      << publisher.errors();

  std::optional<int> code;
  std::atomic<bool> ended{false};
  const std::jthread waiter([&] {
    code = monitor->AwaitExit();
    ended = true;
  });
  monitor->Signal(SIGTERM);
  ASSERT_TRUE(Await([&] { return ended.load(); }));

  EXPECT_EQ(code, 0) << monitor->errors();
  counters_ = LastStatusLine(monitor->errors());
  EXPECT_GT(counters_["received"], 20'000U);
  EXPECT_EQ(counters_["diagnosed"], counters_["received"]);
  EXPECT_EQ(counters_["decisions"] + counters_["decisions_unsent"],
            counters_["received"] - counters_["late"] - counters_["repeat"]);
  EXPECT_EQ(counters_["recorded"] + counters_["record_dropped"],
            counters_["received"])
      << monitor->errors();
  EXPECT_TRUE(
      storage::HistoryReader(data_ / "history.db").Sessions().at(0).clean);
  for (const storage::RunInfo& run :
       storage::RunStore(data_ / "runs.db").List()) {
    EXPECT_EQ(run.state, storage::RunState::kComplete);
  }
}

// Events that the history cannot store in time go out as not persisted.
TEST_F(LoadTest, AStormOfAThousandValvesIsStoredAndPublished) {
  constexpr std::uint64_t kStorm = 1'000;
  constexpr std::uint64_t kSamples = 90;
  samples_.emplace(*participant_,
                   idl::PublisherOptions{idl::Profile::kLossless, kStorm});
  const auto monitor = StartMonitor();
  const std::jthread publisher([this] {
    for (std::uint64_t k = 0; k < kSamples; ++k) {
      const bool fails = k >= 30 && k < 50;
      for (std::uint64_t v = 0; v < kStorm; ++v) {
        samples_->Write(
            {"V" + std::to_string(v), PlantSample(k, fails ? kF7Offset : 0.0)});
      }
    }
  });
  ASSERT_TRUE(Await([this] {
    return counters_["diagnosed"] == kSamples * kStorm;
  })) << counters_["diagnosed"]
      << " of " << counters_["received"] << ", " << vectors_.size()
      << " vectors, " << faults_.size() << " events";
  ASSERT_TRUE(Await([this] {
    return std::ranges::count(faults_, TransitionKind::kClosed, [](auto& e) {
             return e.transition.kind;
           }) == kStorm;
  }));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  const auto unpersisted = static_cast<std::size_t>(
      std::ranges::count(faults_, false, &FaultEvent::persisted));
  std::cout << "storm: " << faults_.size() << " events, " << unpersisted
            << " before they were stored\n";
  // The number depends on the disk: it has 200 ms.
  EXPECT_LT(unpersisted, faults_.size());
  const auto episodes = storage::HistoryReader(data_ / "history.db").List();
  EXPECT_EQ(episodes.size(), kStorm);
  EXPECT_TRUE(std::ranges::all_of(
      episodes, [](const auto& e) { return e.end_reason == "cleared"; }));
}

// The vectors of one valve as they come; kept small, for they are many.
struct Stream {
  std::uint64_t next_seq{0};
  std::uint64_t misplaced{0};
  std::uint64_t model_hash{0};
  int swaps{0};
  bool settles{true};  ///< The first vector of each set says so.

  void Add(const idl::DecisionMessage& vector) {
    misplaced += vector.verdict.seq == next_seq ? 0 : 1;
    next_seq = vector.verdict.seq + 1;
    if (vector.model_hash != model_hash) {
      swaps += model_hash == 0 ? 0 : 1;
      model_hash = vector.model_hash;
      settles = settles && vector.verdict.quality == Quality::kSettling;
    }
  }
};

TEST_F(LoadTest, AModelSetSwappedUnderLoadLosesAndDoublesNothing) {
  std::map<std::string, Stream> streams;
  const auto await = [&](const auto& condition) {
    const Clock::time_point deadline = Clock::now() + kMonitorPatience;
    while (!condition() && Clock::now() < deadline) {
      decisions_->Take(
          idl::ForEachVector(
              [&](const idl::DecisionMessage& vector, const auto&) {
                streams[vector.valve_id].Add(vector);
              }),
          std::chrono::milliseconds(10), 10);
    }
    return condition();
  };
  const auto all = [&](const auto& condition) {
    return streams.size() == kValves &&
           std::ranges::all_of(streams, condition,
                               &std::pair<const std::string, Stream>::second);
  };
  const auto monitor = StartMonitor();
  std::jthread publisher = PublishAll(1'000'000'000);
  ASSERT_TRUE(await([&] {
    return all([](const Stream& stream) { return stream.next_seq > 100; });
  }));

  ModelSet next = LinearModels();
  next.decision.isolation_samples = 7;
  StoreModels(data_, next);
  ASSERT_TRUE(await([&] {
    return all([](const Stream& stream) { return stream.swaps > 0; });
  })) << monitor->errors();
  publisher.request_stop();
  publisher.join();
  const bool complete = await([&] {
    return all(
        [&](const Stream& stream) { return stream.next_seq == published_; });
  });

  EXPECT_TRUE(complete);
  for (const auto& [valve, stream] : streams) {
    EXPECT_EQ(stream.next_seq, published_) << valve;
    EXPECT_EQ(stream.misplaced, 0U) << valve;
    EXPECT_EQ(stream.swaps, 1) << valve;
    EXPECT_TRUE(stream.settles) << valve;
  }
}

}  // namespace
}  // namespace fdi::monitor
