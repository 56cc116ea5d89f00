// Records that the monitor keeps each minute: time by quality, accumulators.
#include "monitor/checkpoint.h"

#include <optional>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/pipeline.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using testing::UnorderedElementsAre;

constexpr std::int64_t kDay = 86'400'000'000'000;
constexpr int kWindow = 200;
// The mean would pass its limit some 20 samples later.
constexpr std::uint64_t kStop = 700;

TEST(CheckpointTest, TimeIsBookedOnTheDayOfItsSample) {
  CoverageBook book;
  book.Add(3 * kDay - 1, Quality::kLive);
  book.Add(3 * kDay, Quality::kLive, 5);
  book.Add(3 * kDay, Quality::kStale, 2);
  std::vector<CoverageDay> days;
  book.DrainInto("V1", 2.0, days);
  ASSERT_EQ(days.size(), 2U);
  EXPECT_EQ(days[0].day, 2);
  EXPECT_EQ(days[0].samples[Quality::kLive], 1U);
  EXPECT_EQ(days[1].day, 3);
  EXPECT_EQ(days[1].period_s, 2.0);
  EXPECT_EQ(days[1].samples[Quality::kLive], 5U);
  EXPECT_EQ(days[1].samples[Quality::kStale], 2U);
  days.clear();
  book.DrainInto("V1", 2.0, days);
  EXPECT_TRUE(days.empty());
}

TEST(CheckpointTest, DaysAreBoundedAndOfAcceptedSamples) {
  CoverageBook book;
  for (int day = 0; day < 1000; ++day) {
    book.Add(day * kDay, Quality::kLive);
    book.Add((day + 5000) * kDay, Quality::kBadInput, 1, false);
  }
  EXPECT_EQ(book.rows(), kMaxBookRows);
  std::vector<CoverageDay> days;
  book.DrainInto("V1", 1.0, days);
  QualityCount all;
  for (const CoverageDay& day : days) {
    EXPECT_LT(day.day, 1000);
    all.Add(day.samples);
  }
  EXPECT_EQ(all[Quality::kLive], 1000U);
  EXPECT_EQ(all[Quality::kBadInput], 1000U);
}

TEST(CheckpointTest, MergingAddsTimeAndKeepsTheNewestAccumulator) {
  CoverageBook book;
  Checkpoint older;
  book.Add(0, Quality::kLive, 3);
  book.DrainInto("V1", 1.0, older.coverage);
  older.accumulators = {{"V1", 1, 1, 10, {}}, {"V2", 1, 1, 10, {}}};
  Checkpoint newer;
  book.Add(0, Quality::kLive, 4);
  book.DrainInto("V1", 1.0, newer.coverage);
  book.Add(kDay, Quality::kLive, 1);
  book.DrainInto("V1", 1.0, newer.coverage);
  newer.accumulators = {{"V1", 1, 1, 20, {}}};

  const Checkpoint merged = Merged(older, newer);
  ASSERT_EQ(merged.coverage.size(), 2U);
  EXPECT_EQ(merged.coverage[0].samples[Quality::kLive], 7U);
  EXPECT_EQ(merged.coverage[1].samples[Quality::kLive], 1U);
  std::vector<std::pair<std::string, std::int64_t>> stamps;
  for (const Accumulator& accumulator : merged.accumulators) {
    stamps.emplace_back(accumulator.valve_id, accumulator.stamp_ns);
  }
  EXPECT_THAT(stamps, UnorderedElementsAre(testing::Pair("V1", 20),
                                           testing::Pair("V2", 10)));
}

// X off by 1 does not reach the threshold of 5, but the mean of 200 samples
// that of 0.8.
std::shared_ptr<const ModelSet> WatchedModels() {
  ModelSet models = LinearModels();
  WindowLimits limits;
  limits.length = kWindow;
  limits.lower_mean = -0.8;
  limits.upper_mean = 0.8;
  limits.upper_log_rms = 5.0;
  models.channels[0].windows = {limits};
  return std::make_shared<const ModelSet>(std::move(models));
}

class RestartTest : public testing::Test {
 protected:
  RestartTest() {
    options_.journal.commit_period = milliseconds(5);
    options_.journal.retry_period = milliseconds(5);
  }

  // One session over samples [from, to); the fault begins at 400.
  Checkpoint Session(std::uint64_t from, std::uint64_t to,
                     std::vector<Accumulator> kept = {},
                     const std::string& valve = "V1") {
    FakeBus bus;
    FakeHistory history;
    Pipeline pipeline(options_, PipelineSinks{bus, bus, history},
                      std::make_shared<FixedResolver>(WatchedModels()),
                      context_);
    pipeline.Start({}, std::move(kept));
    for (std::uint64_t k = from; k < to; ++k) {
      pipeline.OnSample(valve, PlantSample(k, k < 400 ? 0.0 : 1.0), 1);
    }
    pipeline.Stop();
    detected_.reset();
    if (!history.detected.empty()) {
      detected_ = history.detected.front();
    }
    return history.checkpoint_sum;
  }

  PipelineOptions options_;
  Counters counters_;
  ThrottledLog log_{[](LogLevel, std::string_view) {}};
  MonitorContext context_{counters_, log_, [] { return std::int64_t{1'000}; }};
  std::optional<std::int64_t> detected_;
};

TEST_F(RestartTest, AccumulatorsCarryASlowFaultOverARestart) {
  Session(0, 1000);
  ASSERT_TRUE(detected_);
  const std::int64_t uninterrupted = *detected_;

  const Checkpoint kept = Session(0, kStop);
  ASSERT_FALSE(detected_);
  ASSERT_EQ(kept.accumulators.size(), 1U);
  EXPECT_EQ(kept.accumulators[0].stamp_ns, PlantSample(kStop - 1).stamp_ns);
  EXPECT_EQ(kept.accumulators[0].source_id, 1U);
  Session(kStop, 1000, kept.accumulators);
  ASSERT_TRUE(detected_);
  const std::int64_t resumed = *detected_;
  Session(kStop, 1000);
  ASSERT_TRUE(detected_);
  const std::int64_t forgotten = *detected_;

  // No later than the samples that the engine settles for.
  const std::int64_t settling = kSettlingSamples * std::int64_t{1'000'000'000};
  EXPECT_LE(resumed, uninterrupted + settling);
  EXPECT_GT(forgotten, resumed + 50 * std::int64_t{1'000'000'000});
}

TEST_F(RestartTest, AccumulatorsOfAnotherSourceAreNotUsed) {
  Checkpoint kept = Session(0, kStop);
  Session(kStop, 1000);
  const std::optional<std::int64_t> forgotten = detected_;
  kept.accumulators.at(0).source_id = 2;
  Session(kStop, 1000, kept.accumulators);
  EXPECT_EQ(detected_, forgotten);
}

TEST_F(RestartTest, AllTimeIsAccountedFor) {
  const Checkpoint kept = Session(0, 300);
  ASSERT_EQ(kept.coverage.size(), 1U);
  const QualityCount& samples = kept.coverage[0].samples;
  EXPECT_EQ(samples[Quality::kSettling], std::uint64_t{kSettlingSamples});
  EXPECT_EQ(samples[Quality::kLive], 300U - kSettlingSamples);
  EXPECT_EQ(counters_[Quality::kLive], 300U - kSettlingSamples);
  EXPECT_EQ(kept.coverage[0].day, PlantSample(0).stamp_ns / kDay);

  const Checkpoint bare = Session(0, 50, {}, "bare1");
  EXPECT_EQ(bare.coverage.at(0).samples[Quality::kUnassigned], 50U);
  EXPECT_TRUE(bare.accumulators.empty());
}

TEST_F(RestartTest, AHistoryThatFailsGetsAllTimeLater) {
  options_.checkpoint_period = milliseconds(1);
  FakeBus bus;
  FakeHistory history;
  history.broken = true;
  Pipeline pipeline(options_, PipelineSinks{bus, bus, history},
                    std::make_shared<FixedResolver>(WatchedModels()), context_);
  pipeline.Start({});
  for (std::uint64_t k = 0; k < 200; ++k) {
    pipeline.OnSample("V1", PlantSample(k), 1);
  }
  while (!pipeline.history_degraded()) {
    pipeline.Poll();
    std::this_thread::yield();
  }
  history.notice.Apply([&] { history.broken = false; });
  pipeline.Stop();
  ASSERT_EQ(history.checkpoint_sum.coverage.size(), 1U);
  EXPECT_EQ(history.checkpoint_sum.coverage[0].samples[Quality::kLive],
            200U - kSettlingSamples);
}

TEST_F(RestartTest, AProvisionalBaselineIsDetectedAndNotNamed) {
  for (const bool provisional : {false, true}) {
    FakeBus bus;
    FakeHistory history;
    Pipeline pipeline(options_, PipelineSinks{bus, bus, history},
                      std::make_shared<FixedResolver>(SharedLinearModels()),
                      context_);
    pipeline.Start({});
    for (std::uint64_t k = 0; k < 100; ++k) {
      pipeline.OnSample(provisional ? "provisional1" : "V1",
                        PlantSample(k, k < 50 ? 0.0 : kF7Offset), 1);
    }
    pipeline.Stop();
    ASSERT_FALSE(bus.events.empty());
    EXPECT_EQ(bus.events.front().first, TransitionKind::kDetected);
    EXPECT_EQ(bus.events.size(), provisional ? 1U : 2U);
  }
}

TEST(ValveMonitorCheckpointTest, SilenceOfAStaleValveIsTimeToo) {
  ValveMonitor valve("V1", EngineParts(SharedLinearModels()), {});
  FakeOutlet outlet;
  const auto start = ValveMonitor::TimePoint{};
  valve.Step(PlantSample(0), 1, start, outlet);
  EXPECT_EQ(valve.CountStale(start + milliseconds(2500)), 0U);
  ASSERT_TRUE(valve.CheckStale(start + milliseconds(3500), outlet));
  EXPECT_EQ(valve.CountStale(start + milliseconds(3500)), 3U);
  EXPECT_EQ(valve.CountStale(start + milliseconds(10'200)), 7U);
  Checkpoint checkpoint;
  valve.TakeCheckpoint(checkpoint);
  EXPECT_EQ(checkpoint.coverage.at(0).samples[Quality::kStale], 10U);
  EXPECT_TRUE(checkpoint.accumulators.empty());  // It does not speak.
}

}  // namespace
}  // namespace fdi::monitor
