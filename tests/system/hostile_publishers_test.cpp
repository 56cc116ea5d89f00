// Publishers that do what none should, against the built fdi-monitor over DDS.

#include <cmath>
#include <csignal>
#include <fstream>
#include <iostream>
#include <limits>
#include <thread>

#include <gmock/gmock.h>

#include "storage/history/history_reader.h"
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

  static std::size_t ResidentBytes(const ChildProcess& process) {
    std::ifstream file("/proc/" + std::to_string(process.pid()) + "/statm");
    std::size_t total = 0;
    std::size_t resident = 0;
    file >> total >> resident;
    return resident * 4096;
  }

  /// Waits until so many samples went through engines, whatever their verdict.
  bool AwaitDiagnosed(std::uint64_t count) {
    return Await([this, count] { return counters_["diagnosed"] >= count; });
  }

  static Sample Shifted(std::uint64_t k, std::int64_t shift_s) {
    Sample sample = PlantSample(k);
    sample.stamp_ns += shift_s * 1'000'000'000;
    return sample;
  }
};

TEST_F(HostilePublishersTest, TenThousandValveIdsAreCountedAndCostLittle) {
  constexpr int kIds = 10'000;
  constexpr int kRounds = 3;
  const auto monitor = StartMonitor({"--max-valves", "50"});
  Publish(0, 40);
  ASSERT_TRUE(AwaitVectors(40));
  const std::size_t before = ResidentBytes(*monitor);

  Stranger stranger(domain_.id(), kIds);
  for (int round = 0; round < kRounds; ++round) {
    for (int id = 0; id < kIds; ++id) {
      ASSERT_EQ(stranger.samples.Write(
                    {"hostile" + std::to_string(id),
                     PlantSample(static_cast<std::uint64_t>(round), 0.0, 2)},
                    {}, kMonitorPatience),
                idl::WriteResult::kSent);
    }
  }
  Publish(40, 80);
  const auto of_v1 = [this] {
    return std::ranges::count(vectors_, "V1", &idl::DecisionMessage::valve_id);
  };
  ASSERT_TRUE(Await([&] { return of_v1() == 80; })) << of_v1();
  const auto accounted = [this] {
    return counters_["dds_rejected_instances"] + counters_["received"];
  };
  Await([&] { return accounted() >= 80U + kIds * kRounds; });
  EXPECT_EQ(accounted(), 80U + kIds * kRounds);
  EXPECT_EQ(counters_["received"],
            counters_["refused_samples"] + counters_["accepted"]);
  EXPECT_EQ(counters_["valves"], 50U);
  EXPECT_LT(ResidentBytes(*monitor), before + (32U << 20U));
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

  EXPECT_EQ(counters_["gaps"], 2U);  // Of more than three periods.
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

// With every sample another day and another epoch, as fast as the bus takes it.
TEST_F(HostilePublishersTest, JumpsCostAValveItsShareAndOthersNothing) {
  constexpr std::uint64_t kHonest = 60;
  const auto monitor = StartMonitor();
  Publish(0, 1);
  ASSERT_TRUE(AwaitVectors(1));
  const std::size_t before = ResidentBytes(*monitor);
  Stranger stranger(domain_.id(), 10);
  std::uint64_t sent = 0;
  std::jthread flood([&](const std::stop_token& stop) {
    for (; !stop.stop_requested(); ++sent) {
      const auto days = static_cast<std::int64_t>(sent * 7919 % 20'000);
      Sample sample = Shifted(sent, days * 86'400);
      sample.source_id = 2;
      sample.epoch = static_cast<std::uint32_t>(sent);
      stranger.samples.Write({"J" + std::to_string(sent % 4), sample}, {},
                             kMonitorPatience);
    }
  });
  const auto of_v1 = [this] {
    return static_cast<std::uint64_t>(
        std::ranges::count(vectors_, "V1", &idl::DecisionMessage::valve_id));
  };
  std::vector<double> delays_ms;
  for (std::uint64_t k = 1; k < kHonest; ++k) {
    const auto start = std::chrono::steady_clock::now();
    Publish(k, k + 1);
    ASSERT_TRUE(Await([&] { return of_v1() == k + 1; }));
    const std::chrono::duration<double, std::milli> delay =
        std::chrono::steady_clock::now() - start;
    delays_ms.push_back(delay.count());
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  flood.request_stop();
  flood.join();
  ASSERT_TRUE(Await([&] { return counters_["received"] == kHonest + sent; }));

  std::ranges::sort(delays_ms);
  std::cout << "jumps: " << sent << " sent, " << counters_["over_share"]
            << " over the share; honest valve p50 "
            << delays_ms[delays_ms.size() / 2] << " ms, worst "
            << delays_ms.back() << " ms; memory +"
            << (ResidentBytes(*monitor) - before) / 1024 << " kB\n";
  EXPECT_GT(counters_["over_share"], sent / 2);
  EXPECT_EQ(
      counters_["accepted"] + counters_["period"] + counters_["over_share"],
      kHonest + sent);
  EXPECT_LT(ResidentBytes(*monitor), before + (48U << 20U));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
}

// The library throws in destructors then: that was an abort.
TEST_F(HostilePublishersTest, WithoutAddressSpaceTheStartFailsWithAMessage) {
  std::string command = "ulimit -v 130000; exec";
  for (const std::string& word : Command({})) {
    command += " '" + word + "'";
  }
  ChildProcess monitor({"/bin/bash", "-c", command});
  const auto code = monitor.AwaitExit();
  ASSERT_TRUE(code);
  EXPECT_GT(*code, 0);
  EXPECT_LT(*code, 128) << monitor.errors();
  EXPECT_THAT(monitor.errors(), testing::HasSubstr("error: "));
}

// It takes part in the lossless stream, and its places are full. Each vector
// that waits for it took 50 ms at the end.
TEST_F(HostilePublishersTest, ASubscriberThatDoesNotReadDoesNotDelayTheEnd) {
  const auto monitor = StartMonitor();
  Publish(0, 6000);
  const auto deadline = std::chrono::steady_clock::now() + kMonitorPatience;
  while (counters_["dds_decision_retries"] == 0 &&
         std::chrono::steady_clock::now() < deadline) {
    status_->Take({[this](const idl::MonitorStatusMessage& m, const auto&) {
                     counters_ = {m.counters.begin(), m.counters.end()};
                   },
                   {}},
                  std::chrono::milliseconds(100));
  }
  ASSERT_GT(counters_["dds_decision_retries"], 0U);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(std::chrono::seconds(5)), 0);
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
