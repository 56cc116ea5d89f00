// Publishers that do what none should, against the built fdi-monitor over DDS.

#include <cmath>
#include <csignal>
#include <functional>
#include <iostream>
#include <limits>
#include <thread>

#include <gmock/gmock.h>

#include "base/passing_error.h"
#include "storage/history/history_reader.h"
#include "tests/system/attack.h"
#include "tests/system/honest_valve.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

class HostilePublishersTest : public MonitorFixture {
 protected:
  HostilePublishersTest() { StoreModels(data_, LinearModels()); }

  /// A publisher in a participant of its own, for so many valves.
  struct Stranger {
    Stranger(int domain, int valves) : participant(Options(domain, valves)) {
      EXPECT_TRUE(samples.WaitForReaders(1, kMonitorPatience));
    }
    static idl::DdsOptions Options(int domain, int valves) {
      idl::DdsOptions options;
      options.domain = domain;
      options.max_valves = valves;
      return options;
    }

    idl::Participant participant;
    idl::Publisher<idl::ValveSampleMessage> samples{
        participant, {idl::Profile::kLossless, 0}};
  };

  /// Publishes sample after sample as AttackTime() goes on, 20 000 a second.
  /// @returns how many.
  std::uint64_t Flood(
      int ids,
      const std::function<idl::ValveSampleMessage(std::uint64_t)>& nth) {
    Stranger stranger(domain_.id(), ids);
    std::uint64_t sent = 0;
    std::jthread flood([&](const std::stop_token& stop) {
      for (auto next = std::chrono::steady_clock::now(); !stop.stop_requested();
           next += std::chrono::milliseconds(5)) {
        for (int i = 0; i < 100; ++i, ++sent) {
          stranger.samples.Write(nth(sent), {}, kMonitorPatience);
        }
        std::this_thread::sleep_until(next);
      }
    });
    TakeFor(AttackTime());
    flood.request_stop();
    flood.join();
    stranger.samples.WaitForAcknowledged(kMonitorPatience);
    return sent;
  }

  /// Waits until so many samples went through engines, whatever their verdict.
  bool AwaitDiagnosed(std::uint64_t count) {
    return Await([this, count] { return counters_["diagnosed"] >= count; });
  }

  // For a shell.
  static std::string Words(const std::vector<std::string>& command) {
    std::string line;
    for (const std::string& word : command) {
      line += " '" + word + "'";
    }
    return line;
  }

  static Sample Shifted(std::uint64_t k, std::int64_t shift_s) {
    Sample sample = PlantSample(k);
    sample.stamp_ns += shift_s * 1'000'000'000;
    return sample;
  }
};

TEST_F(HostilePublishersTest, TenThousandValveIdsAreCountedAndCostLittle) {
  constexpr int kIds = 10'000;
  const auto monitor = StartMonitor({"--max-valves", "50"});
  HonestValve honest(domain_.id());
  const double before = PeakMemory(monitor->pid());
  const std::uint64_t sent = Flood(kIds, [](std::uint64_t n) {
    return idl::ValveSampleMessage{"hostile" + std::to_string(n % kIds),
                                   PlantSample(n / kIds, 0.0, 2)};
  });
  const HonestValve::Delays delays = honest.Stop();
  const std::uint64_t published = sent + honest.sent();
  const auto accounted = [this] {
    return counters_["dds_rejected_instances"] + counters_["received"];
  };
  Await([&] { return accounted() >= published; });

  std::cout << "ids: " << sent << " sent; " << delays << "; memory " << before
            << " and " << PeakMemory(monitor->pid()) << " MB\n";
  EXPECT_EQ(accounted(), published);
  EXPECT_EQ(counters_["received"], counters_["refused_samples"] +
                                       counters_["accepted"] +
                                       counters_["over_share"]);
  EXPECT_EQ(counters_["valves"], 50U);
  ExpectPunctual(delays);
  EXPECT_LT(PeakMemory(monitor->pid()), before + 32.0);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
}

TEST_F(HostilePublishersTest, OfTwoPublishersOfOneValveTheNewerIsDiagnosed) {
  const auto monitor = StartMonitor();
  Publish(0, 40);
  ASSERT_TRUE(AwaitVectors(40));
  Stranger second(domain_.id(), 100);
  for (std::uint64_t k = 40; k < 100; ++k) {
    // One at a time: only so is it known who is first.
    ASSERT_EQ(second.samples.Write({"V1", PlantSample(k, kF7Offset, 2)}),
              idl::WriteResult::kSent);
    ASSERT_TRUE(AwaitVectors(k + 1));
    Publish(PlantSample(k));
  }
  ASSERT_TRUE(AwaitDiagnosed(160));

  EXPECT_EQ(counters_["superseded"], 60U);
  EXPECT_TRUE(Await([this] { return health_ == idl::Health::kDegraded; }));
  EXPECT_EQ(counters_["valves_two_publishers"], 1U);
  EXPECT_TRUE(monitor->AwaitLine("two_publishers id=M118 valves=1 first=V1"));
  ASSERT_EQ(vectors_.size(), 100U);
  for (std::size_t k = 0; k < 100; ++k) {
    EXPECT_EQ(vectors_[k].verdict.source_id, k < 40 ? 1U : 2U) << k;
    EXPECT_EQ(vectors_[k].verdict.seq, k);
  }
  EXPECT_EQ(vectors_[40].verdict.quality, Quality::kSettling);
  EXPECT_EQ(vectors_[99].verdict.state, State::kIsolated);
}

// A second, a minute and an hour are missing.
TEST_F(HostilePublishersTest, GapsOfAnyLengthSettleAndLongOnesAreKept) {
  const auto monitor = StartMonitor();
  const std::vector<std::uint64_t> starts{0, 41, 141, 3'781};
  for (const std::uint64_t start : starts) {
    Publish(start, start + 40);
  }
  ASSERT_TRUE(AwaitVectors(160));
  ASSERT_TRUE(AwaitDiagnosed(160));
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0);

  EXPECT_EQ(counters_["gaps"], 2U);  // Longer than three periods.
  EXPECT_EQ(counters_["initialisations"], 4U);
  EXPECT_EQ(counters_["episodes"], 0U);
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const idl::DecisionMessage& first = vectors_[40 * i];
    EXPECT_EQ(first.verdict.seq, starts[i]);
    EXPECT_EQ(first.verdict.quality, Quality::kSettling);
    EXPECT_EQ(vectors_[40 * i + 39].verdict.quality, Quality::kLive);
  }
  std::vector<std::int64_t> lengths_s;
  for (const DataGap& gap :
       storage::HistoryReader(data_ / "history.db").Gaps()) {
    if (gap.valve_id == "V1") {
      lengths_s.push_back((gap.to_ns - gap.from_ns) / 1'000'000'000);
    }
  }
  EXPECT_THAT(lengths_s, testing::UnorderedElementsAre(61, 3'601));
}

TEST_F(HostilePublishersTest, AClockThatStepsByAnHourIsAGapEachTime) {
  const auto monitor = StartMonitor();
  constexpr std::int64_t kHour = 3'600;
  const std::vector<std::int64_t> shifts{0, -kHour, 0, kHour, 0};
  std::uint64_t seq = 0;
  for (const std::int64_t shift : shifts) {
    for (int i = 0; i < 40; ++i) {
      Publish(Shifted(seq++, shift));
    }
  }
  ASSERT_TRUE(AwaitVectors(200)) << vectors_.size();
  ASSERT_TRUE(AwaitDiagnosed(200));

  EXPECT_EQ(counters_["initialisations"], 5U);
  EXPECT_EQ(counters_["episodes"], 0U);
  EXPECT_EQ(counters_["accepted"], 200U);
  EXPECT_EQ(vectors_[199].verdict.quality, Quality::kLive);
}

// With every sample another day and another epoch.
TEST_F(HostilePublishersTest, JumpsCostAValveItsShareAndOthersNothing) {
  const auto monitor = StartMonitor();
  HonestValve honest(domain_.id());
  const double before = PeakMemory(monitor->pid());
  const std::uint64_t sent = Flood(10, [](std::uint64_t n) {
    const auto days = static_cast<std::int64_t>(n * 7919 % 20'000);
    Sample sample = Shifted(n, days * 86'400);
    sample.source_id = 2;
    sample.epoch = static_cast<std::uint32_t>(n);
    return idl::ValveSampleMessage{"J" + std::to_string(n % 4), sample};
  });
  const HonestValve::Delays delays = honest.Stop();
  const std::uint64_t published = sent + honest.sent();
  ASSERT_TRUE(Await([&] { return counters_["received"] >= published; }));

  std::cout << "jumps: " << sent << " sent, " << counters_["over_share"]
            << " over the share; " << delays << "; memory " << before << " and "
            << PeakMemory(monitor->pid()) << " MB\n";
  EXPECT_GT(counters_["over_share"], sent / 2);
  EXPECT_EQ(counters_["received"], published);
  EXPECT_EQ(
      counters_["accepted"] + counters_["period"] + counters_["over_share"],
      published);
  ExpectPunctual(delays);
  EXPECT_LT(PeakMemory(monitor->pid()), before + 48.0);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
}

// The library throws in destructors then, or ends the process by an assertion.
TEST_F(HostilePublishersTest, WithoutAddressSpaceTheStartFailsWithAMessage) {
  for (const std::string limit : {"130000", "300000"}) {
    ChildProcess monitor(
        {"/bin/bash", "-c",
         "ulimit -v " + limit + "; exec" + Words(Command({}))});
    const auto code = monitor.AwaitExit();
    EXPECT_EQ(code, kExitPassing) << limit << monitor.errors();
    EXPECT_THAT(monitor.errors(), testing::HasSubstr("error: no room for "));
  }
}

TEST_F(HostilePublishersTest, AFullLogHoldsUpNeitherTheStartNorTheEnd) {
  ChildProcess monitor(
      {"/bin/bash", "-c",
       "exec 2> >(exec sleep 20); timeout 0.2 head -c 1000000 /dev/zero >&2; "
       "exec" +
           Words(Command({}))});
  speaker_ = ":" + std::to_string(monitor.pid());
  EXPECT_TRUE(Await([this] { return !counters_.empty(); }));
  Publish(0, 40);
  EXPECT_TRUE(AwaitVectors(40));
  monitor.Signal(SIGTERM);
  EXPECT_EQ(monitor.AwaitExit(), 0);
}

// It takes part in the lossless stream, and its places are full. Each vector
// that waits for it took 50 ms at the end.
TEST_F(HostilePublishersTest, ASubscriberThatDoesNotReadDoesNotDelayTheEnd) {
  const auto monitor = StartMonitor();
  const auto deadline = std::chrono::steady_clock::now() + kMonitorPatience;
  // The speed of both sides decides how many vectors share a message.
  for (std::uint64_t k = 0; counters_["dds_decision_retries"] == 0 &&
                            std::chrono::steady_clock::now() < deadline;
       k += 1000) {
    Publish(k, k + 1000);
    status_->Take({[this](const idl::MonitorStatusMessage& m, const auto&) {
                     counters_ = {m.counters.begin(), m.counters.end()};
                   },
                   {}},
                  std::chrono::milliseconds(100));
  }
  ASSERT_GT(counters_["dds_decision_retries"], 0U);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0);
  EXPECT_THAT(monitor->errors(), testing::HasSubstr(" decisions_unsent="));
}

// All at once, in disorder and twice; then the fault must still be found.
TEST_F(HostilePublishersTest, DisorderAndNonsenseAreCountedByReason) {
  const auto monitor = StartMonitor();
  Publish(0, 40);
  const auto with = [](std::uint64_t k, double value) {
    Sample sample = PlantSample(k);
    sample.Set(Signal::kX, value);
    return sample;
  };
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Publish(with(40, kInfinity));
  Publish(with(41, -kInfinity));
  Publish(with(42, std::nan("")));
  Publish(with(43, std::numeric_limits<double>::max()));
  Publish(with(44, std::numeric_limits<double>::denorm_min()));
  for (const std::uint64_t k : {46, 45, 46, 45, 3, 47}) {
    Publish(PlantSample(k));
  }
  Sample extreme = PlantSample(48);
  extreme.stamp_ns = idl::kMaxStampNs;
  Publish(extreme);
  extreme.stamp_ns = idl::kMinStampNs;
  extreme.seq = 49;
  Publish(extreme);
  Publish(50, 100);
  Publish(100, 130, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(AwaitDiagnosed(133));

  EXPECT_EQ(counters_["not_finite"], 3U);
  EXPECT_EQ(counters_["range"], 1U);
  EXPECT_EQ(counters_["late"], 3U);
  EXPECT_EQ(counters_["repeat"], 1U);
  EXPECT_EQ(counters_["received"],
            counters_["accepted"] + 8U + counters_["period"]);
  EXPECT_EQ(faults_.back().candidates.at(0).fault, 7);
}

}  // namespace
}  // namespace fdi::monitor
