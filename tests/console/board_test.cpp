#include <array>
#include <cmath>
#include <thread>

#include <gmock/gmock.h>

#include "tests/console/board_fixture.h"

namespace fdi::console {
namespace {

using monitor::kF7Offset;
using monitor::PlantSample;

using LiveBoardTest = BoardTest;

TEST_F(LiveBoardTest, ShowsWhatTheEngineSaidLast) {
  Show(0, 50);
  Show(50, 80, kF7Offset);

  const ValveState valve = board_.Trend("V1").value().now;
  EXPECT_EQ(valve.state, State::kIsolated);
  EXPECT_EQ(valve.isolated, 2U);  // f7 is fault 1 of {f1, f7}.
  EXPECT_EQ(valve.factor, engine_.verdict().fault_factors[1]);
  EXPECT_EQ(valve.strength, engine_.verdict().strengths[1]);
  EXPECT_EQ(valve.stamp_ns, PlantSample(79).stamp_ns);
  EXPECT_EQ(valve.models->model_set, "linear@1");
  ASSERT_EQ(valve.spark.size(), 60U);
  EXPECT_EQ(valve.spark.front(), 0.0);
  EXPECT_NEAR(valve.spark.back(), 1.0, 1e-6);
}

TEST_F(LiveBoardTest, TheTrendHoldsTheLast900InstantsOverAnIsolation) {
  Show(0, 600);
  Show(600, 1000, kF7Offset);

  const LiveTrend trend = board_.Trend("V1").value();
  ASSERT_EQ(trend.points.size(), kTrendInstants);
  EXPECT_EQ(trend.points.front().sample.seq, 100U);
  EXPECT_EQ(trend.points.back().sample.seq, 999U);
  EXPECT_EQ(trend.points.front().residuals[0], 0.0);
  EXPECT_EQ(trend.points.back().residuals[0], kF7Offset);
  EXPECT_LT(board_.bytes(), 150'000U);
}

TEST_F(LiveBoardTest, AnAnswerThatFlapsKeepsItsTrend) {
  Verdict verdict;
  for (std::uint64_t k = 0; k < 500; ++k) {
    verdict.isolated = k / 5 % 2;
    board_.OnVerdict("V1", PlantSample(k), {verdict, models_.get(), false});
  }

  EXPECT_EQ(board_.Trend("V1").value().points.size(), 500U);
}

TEST_F(LiveBoardTest, ANewSourceGoesOnWithTheTrend) {
  Show(0, 100);
  Show(200, 210, 0.0, 2);
  Show(300, 310, 0.0, 3);

  const LiveTrend trend = board_.Trend("V1").value();
  ASSERT_EQ(trend.points.size(), 120U);
  EXPECT_EQ(trend.points[100].sample.seq, 200U);
  ASSERT_EQ(trend.gaps.size(), 2U);
  EXPECT_EQ(trend.gaps[0].from_ns, PlantSample(99).stamp_ns);
  EXPECT_EQ(trend.gaps[0].to_ns, PlantSample(200).stamp_ns);
  EXPECT_EQ(board_.TakeGaps().size(), 2U);
  EXPECT_TRUE(board_.TakeGaps().empty());
}

TEST_F(LiveBoardTest, ASourceWithEarlierStampsBeginsTheTrendAnew) {
  Show(1000, 1100);
  const std::uint64_t next = board_.Trend("V1", 0).value().next;

  Show(500, 510, 0.0, 2);

  EXPECT_EQ(board_.Trend("V1").value().points.size(), 10U);
  EXPECT_EQ(board_.Since("V1", next).value().points.size(), 10U);
  EXPECT_TRUE(board_.TakeGaps().empty());
}

TEST_F(LiveBoardTest, SourcesThatComeAndGoDoNotGrowTheTrend) {
  for (std::uint64_t source = 1; source <= 50; ++source) {
    Show(source * 100, source * 100 + 90, 0.0, source);
  }

  const std::size_t grown = board_.Trend("V1", 10'000).value().points.size();
  EXPECT_LE(grown, 4 * 90U);
}

TEST_F(LiveBoardTest, SinceGivesEachInstantOnce) {
  Show(0, 10);
  const std::uint64_t next = board_.Trend("V1", 0).value().next;
  Show(10, 13);
  const LiveTrend news = board_.Since("V1", next).value();

  ASSERT_EQ(news.points.size(), 3U);
  EXPECT_EQ(news.points.front().sample.seq, 10U);
  EXPECT_TRUE(board_.Since("V1", news.next).value().points.empty());
}

TEST_F(LiveBoardTest, AnotherModelSetBeginsTheTrendAnew) {
  Show(0, 50);
  const auto other = monitor::SharedLinearModels(0x5678);
  ValveEngine engine(other);
  const Sample sample = PlantSample(50);
  board_.OnVerdict("V1", sample, {engine.Step(sample), other.get(), true});

  EXPECT_EQ(board_.Trend("V1").value().points.size(), 1U);
  EXPECT_EQ(board_.Trend("V1")->now.models->hash, 0x5678U);
}

TEST_F(LiveBoardTest, AValveWithoutModelsHasReadingsOnly) {
  Verdict verdict;
  verdict.quality = Quality::kUnassigned;
  board_.OnVerdict("bare", PlantSample(0), {verdict, nullptr, false});

  const LiveTrend trend = board_.Trend("bare").value();
  EXPECT_EQ(trend.now.models, nullptr);
  ASSERT_EQ(trend.points.size(), 1U);
  EXPECT_EQ(trend.points[0].sample[Signal::kX], 50.0);
  EXPECT_TRUE(trend.points[0].residuals.empty());
}

TEST_F(LiveBoardTest, SilenceStandsUntilTheNextSample) {
  Show(0, 5);
  const std::uint64_t before = board_.Trend("V1")->now.version;
  board_.OnSilence("V1", monitor::Silence::kStale);
  const ValveState silent = board_.Trend("V1").value().now;
  Show(5, 6);

  EXPECT_EQ(silent.silence, monitor::Silence::kStale);
  EXPECT_GT(silent.version, before);
  EXPECT_EQ(board_.Trend("V1")->now.silence, monitor::Silence::kNone);
}

TEST_F(LiveBoardTest, AnEndedEpisodeIsMarkedAndTheStateReturnsToNormal) {
  Show(0, 50);
  Show(50, 80, kF7Offset);
  FaultEvent event;
  event.valve_id = "V1";
  event.transition.kind = TransitionKind::kClosed;
  event.transition.reason = EndReason::kStaleTimeout;
  board_.AddMark(event);
  event.valve_id = "never seen";
  board_.AddMark(event);

  const LiveTrend trend = board_.Trend("V1").value();
  ASSERT_EQ(trend.marks.size(), 1U);
  EXPECT_EQ(trend.marks[0].text, "stale_timeout");
  EXPECT_EQ(trend.now.state, State::kNormal);
  EXPECT_EQ(trend.now.isolated, 0U);
  EXPECT_FALSE(board_.Trend("never seen"));
}

TEST_F(LiveBoardTest, ReadersAndTheDiagnosisShareIt) {
  Show(0, 1);
  std::jthread reader([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      EXPECT_FALSE(board_.Valves().empty());
      EXPECT_FALSE(board_.Trend("V1").value().points.empty());
    }
  });
  Show(1, 2000);

  EXPECT_EQ(board_.Trend("V1")->now.version, 2000U);
}

TEST_F(LiveBoardTest, AnExpectedValveIsListedBeforeItSendsAndAfterItIsGone) {
  Checkpoint last;
  const std::int64_t seen_ns = PlantSample(0).stamp_ns - 3'600'000'000'000;
  board_.Expect("V1", seen_ns);
  board_.Expect("V0", 0);

  const std::vector<ValveState> before = board_.Valves();
  ASSERT_EQ(before.size(), 2U);
  EXPECT_EQ(before[1].silence, monitor::Silence::kStale);
  EXPECT_EQ(before[1].stamp_ns, seen_ns);
  EXPECT_TRUE(board_.Trend("V1").value().points.empty());

  Show(0, 10);
  const Verdict verdict;
  board_.OnVerdict("guest", PlantSample(0), {verdict, models_.get(), false});
  EXPECT_EQ(board_.Valves().size(), 3U);
  board_.Expect("V1", seen_ns);  // Again, after a reload.
  EXPECT_EQ(board_.Trend("V1").value().now.silence, monitor::Silence::kNone);
  EXPECT_TRUE(board_.Trend("V1").value().gaps.empty());

  board_.OnRemoved("V1", last);
  board_.OnRemoved("guest", last);

  const std::vector<ValveState> after = board_.Valves();
  ASSERT_EQ(after.size(), 2U);
  EXPECT_EQ(after[1].id, "V1");
  EXPECT_EQ(after[1].silence, monitor::Silence::kStale);
  EXPECT_EQ(after[1].stamp_ns, PlantSample(9).stamp_ns);

  Show(10, 20);
  EXPECT_EQ(board_.Trend("V1").value().points.size(), 10U);
}

}  // namespace
}  // namespace fdi::console
