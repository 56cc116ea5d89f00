#include "monitor/pipeline.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/monitor/pipeline_fixture.h"
#include "tests/monitor/test_support.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

TEST_F(PipelineTest, EverySampleInOrderGivesOneDecision) {
  Start();
  for (std::uint64_t k = 0; k < 1000; ++k) {
    for (const char* valve : {"V1", "V2", "bare1"}) {
      pipeline_->OnSample(valve, PlantSample(k), 1);
    }
  }
  pipeline_->Stop();

  ASSERT_EQ(bus_.decisions.size(), 3000U);
  std::map<std::string, std::uint64_t> next;
  for (const FakeBus::Decision& decision : bus_.decisions) {
    EXPECT_EQ(decision.seq, next[decision.valve_id]++);
  }
  EXPECT_EQ(counters_[Counter::kReceived], 3000U);
  EXPECT_EQ(counters_[Counter::kDiagnosed], 2000U);
  EXPECT_EQ(counters_[Counter::kUnassigned], 1000U);
  EXPECT_EQ(bus_.decisions[2].quality, Quality::kUnassigned);
}

TEST_F(PipelineTest, UnusableSamplesAreCountedByReasonAndTheServiceGoesOn) {
  Start();
  Feed("V1", 0, 10);
  pipeline_->OnSample("V1", BadSample(10), 1);
  Sample far = PlantSample(11);
  far.Set(Signal::kX, 1e6);
  pipeline_->OnSample("V1", far, 1);
  pipeline_->OnSample("V1", PlantSample(11), 1);
  pipeline_->OnSample("V1", PlantSample(3), 1);
  pipeline_->OnSample("", PlantSample(0), 1);
  pipeline_->OnSample(std::string(65, 'x'), PlantSample(0), 1);
  Feed("V1", 12, 20);
  pipeline_->Stop();

  EXPECT_EQ(counters_[Intake::kAccepted], 18U);
  EXPECT_EQ(counters_[Intake::kNotFinite], 1U);
  EXPECT_EQ(counters_[Intake::kRange], 1U);
  EXPECT_EQ(counters_[Intake::kRepeat], 1U);
  EXPECT_EQ(counters_[Intake::kLate], 1U);
  EXPECT_EQ(counters_[Counter::kBadIds], 2U);
  // Bad input is answered, what is out of order is not.
  EXPECT_EQ(bus_.decisions.size(), 20U);
  EXPECT_THAT(lines_, testing::Contains(testing::HasSubstr(
                          "sample_rejected id=M102 reason=not_finite")));
}

TEST_F(PipelineTest, SaysOnceWhichReadingsCameOnChange) {
  Start();
  std::mt19937 random(11);
  double at = 50.0;
  double x = at;
  for (std::uint64_t k = 0; k < 600; ++k) {
    at += 0.002 * static_cast<double>(random() % 1000) - 1.0;
    x = std::abs(at - x) > 0.5 ? at : x;
    Sample sample = PlantSample(k);
    sample.Set(Signal::kX, x);
    pipeline_->OnSample("V1", sample, 1);
    pipeline_->OnSample("V2", PlantSample(k), 1);
  }
  pipeline_->Stop();
  EXPECT_EQ(std::ranges::count_if(lines_,
                                  [](const std::string& line) {
                                    return line.find("readings_held") !=
                                           std::string::npos;
                                  }),
            1);
  EXPECT_THAT(lines_, testing::Contains(testing::HasSubstr(
                          "readings_held id=M120 valve=V1 signals=X")));
}

TEST_F(PipelineTest, ValvesBeyondTheLimitAreCountedNotServed) {
  options_.max_valves = 2;
  options_.valve_glob = "V*";
  Start();
  for (const char* valve : {"V1", "V2", "V3", "V4", "V4", "W1", "V1"}) {
    pipeline_->OnSample(valve, PlantSample(counters_[Counter::kReceived]), 1);
  }
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 3U);
  EXPECT_EQ(counters_[Counter::kRefusedSamples], 3U);
  EXPECT_EQ(counters_[Counter::kFilteredSamples], 1U);
}

TEST_F(PipelineTest, KnownValvesHaveAPlaceAndSilentStrangersGiveTheirsUp) {
  options_.max_valves = 2;
  assigned_ = {"K1"};
  Start();
  const auto start = std::chrono::steady_clock::now();
  const auto offer = [&](const char* valve, std::uint64_t k) {
    pipeline_->OnSample(valve, PlantSample(k), 1,
                        start + std::chrono::seconds(k));
  };
  offer("S1", 0);
  offer("S2", 0);  // The place of K1.
  offer("K1", 0);
  offer("S3", 0);
  EXPECT_THAT(pipeline_->valve_names(), testing::ElementsAre("S1", "K1"));
  EXPECT_EQ(counters_[Counter::kRefusedSamples], 2U);

  pipeline_->Poll(start + std::chrono::seconds(70));
  offer("S3", 71);
  EXPECT_THAT(pipeline_->valve_names(), testing::ElementsAre("K1", "S3"));
  offer("S1", 71);  // S3 speaks.
  EXPECT_EQ(counters_[Counter::kRefusedSamples], 3U);

  // Nobody takes a place by the end of a stream that was never seen.
  pipeline_->OnStreamEnded("S4", 1);
  EXPECT_EQ(pipeline_->valve_names().size(), 2U);
  pipeline_->Stop();
  EXPECT_EQ(bus_.decisions.size(), 3U);
}

TEST_F(PipelineTest, AValveThatIsNoLongerAssignedHasNoPlaceReserved) {
  options_.max_valves = 1;
  assigned_ = {"K1"};
  Start();
  Feed("S1", 0, 1);
  ASSERT_EQ(counters_[Counter::kRefusedSamples], 1U);

  pipeline_->Reassign(std::make_shared<FixedResolver>(models_));
  pipeline_->Poll();
  Feed("S1", 1, 2);
  EXPECT_EQ(counters_[Counter::kRefusedSamples], 1U);
  EXPECT_THAT(pipeline_->valve_names(), testing::ElementsAre("S1"));
}

// Else recorder and bus would keep something of every id that was ever heard.
TEST_F(PipelineTest, TheRunOfAnEvictedValveEndsAndItsLastVectorGoes) {
  options_.max_valves = 1;
  FakeRuns runs;
  Start(&runs);
  const auto start = std::chrono::steady_clock::now();
  for (int v = 0; v < 3; ++v) {
    const auto now = start + std::chrono::seconds(70 * v);
    pipeline_->Poll(now);
    pipeline_->OnSample(ValveName(v), PlantSample(0), 1, now);
  }
  Stop();

  EXPECT_EQ(runs.stored.size(), 3U);
  EXPECT_EQ(runs.ends, 2);
  EXPECT_THAT(bus_.removed, testing::ElementsAre(ValveName(0), ValveName(1)));
}

TEST_F(PipelineTest, AnUnknownValveThatEndedIsForgottenAndASilentOneIsNot) {
  assigned_ = {"known"};
  Start();
  const auto now = std::chrono::steady_clock::now();
  for (const auto& valve : {"ended", "known", "silent"}) {
    pipeline_->OnSample(valve, PlantSample(0), 1, now);
  }
  pipeline_->OnStreamEnded("ended", 1);
  pipeline_->OnStreamEnded("known", 1);
  pipeline_->Poll(now + std::chrono::minutes(59));
  EXPECT_EQ(pipeline_->valve_names().size(), 3U);
  pipeline_->Poll(now + std::chrono::minutes(61));

  EXPECT_THAT(pipeline_->valve_names(),
              testing::ElementsAre("known", "silent"));
  EXPECT_EQ(pipeline_->census().valves, 2U);
  Stop();
}

// Stamps that jump, and epochs that flip, with every sample.
TEST_F(PipelineTest, WhatMakesADiagnosisBeginAnewIsLimited) {
  Start();
  const auto now = std::chrono::steady_clock::now();
  constexpr std::uint64_t kSent = 2000;
  for (std::uint64_t k = 0; k < kSent; ++k) {
    Sample sample = PlantSample(k);
    sample.stamp_ns += (k % 2 == 0 ? 1 : -1) * static_cast<std::int64_t>(k) *
                       86'400'000'000'000;
    pipeline_->OnSample("J 1", sample, 1, now);
    sample = PlantSample(k);
    sample.epoch = static_cast<std::uint32_t>(k);
    pipeline_->OnSample("E1", sample, 1, now);
    pipeline_->OnSample("V1", PlantSample(k), 1, now);
  }
  pipeline_->Poll(now + std::chrono::seconds(1));
  pipeline_->Stop();

  EXPECT_EQ(counters_[Counter::kOverShare], 2 * (kSent - 200));
  EXPECT_EQ(counters_[Intake::kAccepted] + counters_[Intake::kPeriod] +
                counters_[Counter::kOverShare],
            3 * kSent);
  EXPECT_LE(history_.checkpoint_sum.coverage.size(), 202U);
  EXPECT_LE(history_.checkpoint_sum.health.size(), 402U);
  EXPECT_THAT(lines_, testing::Contains(testing::HasSubstr(
                          "id=M117 reason=over_share valve=\"J 1\"")));
}

TEST_F(PipelineTest, AModelSetThatCannotBeHadLeavesTheValveUnassigned) {
  Start();
  Feed("broken1", 0, 5);
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 5U);
  EXPECT_EQ(counters_[Counter::kModelFailures], 1U);
}

// Code that runs before Start() may use the connections of the sinks.
TEST_F(PipelineTest, NoThreadStartsBeforeStart) {
  FakeRuns runs;
  std::thread([] {}).join();  // A sanitizer starts its own with the first.
  const std::size_t before = ThreadCount();
  Make(&runs);
  EXPECT_EQ(ThreadCount(), before);
  recorder_->Start();
  pipeline_->Start({});
  EXPECT_EQ(ThreadCount(), before + 5);
  Stop();
  EXPECT_EQ(ThreadCount(), before);
}

TEST_F(PipelineTest, AVectorThatCannotBeSentCostsNothingElse) {
  bus_.unsendable = "V1";
  Start();
  Feed("V1", 0, 3);
  Feed("V2", 0, 3);
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 3U);
  EXPECT_EQ(counters_[Counter::kDecisionsUnsent], 3U);
  EXPECT_THAT(lines_, testing::Contains(testing::HasSubstr(
                          "valve=V1 reason=\"valve_id cannot be sent\"")));
}

// A copied tag: the healthy readings of another valve under the id of one with
// a fault. The one that is not judged goes on sending.
TEST_F(PipelineTest, AValveThatTwoPublishersSendIsContested) {
  Start();
  const auto start = std::chrono::steady_clock::now();
  const auto at = [start](std::uint64_t k) {
    return start + std::chrono::seconds(k);
  };
  for (const std::string valve : {"V1", "bare"}) {
    for (std::uint64_t k = 0; k < 20; ++k) {
      pipeline_->OnSample(valve, PlantSample(k, kF7Offset), 1, at(k));
      if (k >= 10) {
        Sample old = PlantSample(k, 0.0, 2);
        old.stamp_ns -= 7 * 86'400'000'000'000;  // Last week's record.
        pipeline_->OnSample(valve, old, 2, at(k));
      }
    }
  }
  pipeline_->Poll(at(20));
  EXPECT_EQ(pipeline_->census().contested, 2U);
  EXPECT_EQ(pipeline_->census().contested_valve, "V1");
  EXPECT_THAT(lines_, testing::Contains(testing::HasSubstr(
                          "two_publishers id=M118 valves=2 first=V1")));
  // The publisher that counts is silent, the other one does not replace it at
  // once, but after a minute: nothing else would be judged.
  for (std::uint64_t k = 20; k < 30; ++k) {
    pipeline_->OnSample("V1", PlantSample(k, kF7Offset), 1, at(k));
  }
  pipeline_->Poll(at(30));
  EXPECT_GE(pipeline_->census().stale, 1U);
  EXPECT_EQ(pipeline_->census().contested, 2U);
  for (std::uint64_t k = 30; k < 100; ++k) {
    pipeline_->OnSample("V1", PlantSample(k, kF7Offset), 1, at(k));
  }
  EXPECT_EQ(bus_.decisions.back().valve_id, "V1");
  EXPECT_EQ(bus_.decisions.back().seq, 99U);
  // Or at once where the stream has ended.
  pipeline_->OnStreamEnded("bare", 2);
  pipeline_->OnSample("bare", PlantSample(100, kF7Offset), 1, at(100));
  EXPECT_EQ(bus_.decisions.back().valve_id, "bare");
  EXPECT_EQ(bus_.decisions.back().seq, 100U);
  pipeline_->Poll(at(100));
  EXPECT_EQ(pipeline_->census().contested, 0U);
  pipeline_->Poll(at(120));
  EXPECT_EQ(pipeline_->census().contested, 0U);
  Stop();
}

// The last samples of a publisher that was started anew.
TEST_F(PipelineTest, APublisherThatIsRestartedContestsNothing) {
  Start();
  Feed("V1", 0, 20);
  pipeline_->OnSample("V1", PlantSample(21, 0.0, 2), 2);
  Feed("V1", 22, 25);
  pipeline_->OnSample("V1", PlantSample(26, 0.0, 2), 2);
  pipeline_->Poll(std::chrono::steady_clock::now() + std::chrono::seconds(1));
  EXPECT_EQ(pipeline_->census().contested, 0U);
  Stop();
}

// Runs that cannot even be refused: not a std::exception.
class BrokenRuns : public FakeRuns {
 public:
  void Commit() override { throw 42; }
};

TEST_F(PipelineTest, WhatAThreadEndsWithIsThrownByStop) {
  BrokenRuns runs;
  recorder_options_.lossless = true;
  recorder_options_.queue_samples = 8;
  recorder_options_.commit_period = milliseconds(0);
  Start(&runs);
  Feed("V1", 0, 100);  // Nobody makes room any more, and nobody waits.

  EXPECT_THROW(Stop(), int);
  EXPECT_TRUE(recorder_->failed());
  EXPECT_EQ(bus_.decisions.size(), 100U);
}

TEST_F(PipelineTest, ASwapUnderLoadNeitherLosesNorRepeatsASample) {
  Start();
  std::thread diagnosis([&] {
    for (std::uint64_t k = 0; k < 20'000; k += 100) {
      Feed("V1", k, k + 100);
      pipeline_->Poll();
    }
  });
  const auto seen = [&](std::size_t count) {
    return bus_.notice.Await([&] { return bus_.decisions.size() >= count; });
  };
  ASSERT_TRUE(seen(2000));
  pipeline_->Reassign(
      std::make_shared<FixedResolver>(SharedLinearModels(0x99)));
  diagnosis.join();
  pipeline_->Stop();

  ASSERT_EQ(bus_.decisions.size(), 20'000U);
  bool swapped = false;
  for (std::size_t k = 0; k < bus_.decisions.size(); ++k) {
    EXPECT_EQ(bus_.decisions[k].seq, k);
    const bool is_new = bus_.decisions[k].model_hash == 0x99;
    EXPECT_TRUE(is_new || !swapped) << k;
    swapped = swapped || is_new;
  }
  EXPECT_TRUE(swapped);
  EXPECT_EQ(counters_[Counter::kModelSwaps], 1U);
}

TEST_F(PipelineTest, AnOpenEpisodeOfAValveThatStaysSilentIsClosedUnknown) {
  options_.recovery_window = milliseconds(0);
  Make();
  OpenEpisode open;
  open.valve_id = "gone";
  open.episode_id = 42;
  pipeline_->Start({open});
  pipeline_->Poll(std::chrono::steady_clock::now() + std::chrono::seconds(1));
  ASSERT_TRUE(AwaitEvents(1));
  pipeline_->Stop();

  EXPECT_EQ(bus_.events[0].first, TransitionKind::kClosed);
  EXPECT_EQ(history_.gaps.at(0).reason, "monitor_down");
}

TEST_F(PipelineTest, EveryCounterHasANameOfItsOwn) {
  std::vector<std::string> names;
  for (const Measure& measure : counters_.Measures()) {
    EXPECT_LE(measure.name.size(), 32U);
    names.push_back(measure.name.empty() ? std::string(measure.family)
                                         : measure.name);
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
}

}  // namespace
}  // namespace fdi::monitor
