#include <algorithm>
#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/pipeline.h"
#include "tests/monitor/pipeline_fixture.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

// Tests of what is stored, and of failures of storage.
using PipelineStorageTest = PipelineTest;

TEST_F(PipelineStorageTest, AnEventIsStoredBeforeItIsPublished) {
  Start();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  pipeline_->Stop();

  EXPECT_THAT(bus_.events,
              testing::ElementsAre(std::pair(TransitionKind::kDetected, true),
                                   std::pair(TransitionKind::kIsolated, true)));
  EXPECT_EQ(history_.recorded.size(), 2U);
  EXPECT_EQ(history_.sent, 2);
  EXPECT_EQ(counters_[Counter::kEpisodes], 1U);
  // All evidence up to the stop is there, the episode stays open.
  EXPECT_EQ(history_.trace_points, 80U);
}

// Until then it would be sent again by the next session.
TEST_F(PipelineStorageTest, AnEventIsMarkedAsSentOnceItIsAcknowledged) {
  std::atomic<bool> acknowledged{false};
  std::atomic<int> asked{0};
  options_.journal.acknowledged = [&](milliseconds) {
    ++asked;
    return acknowledged.load();
  };
  options_.journal.delivery_time = milliseconds(0);
  Start();
  OfferEpisode("V1");
  while (asked < 3) {
    std::this_thread::yield();
  }
  EXPECT_EQ(history_.notice.Look([this] { return history_.sent; }), 0);
  acknowledged = true;
  EXPECT_TRUE(history_.notice.Await([this] { return history_.sent == 2; }));
  acknowledged = false;
  OfferEpisode("V2");
  pipeline_->Stop();
  EXPECT_EQ(history_.sent, 2);
}

// If valves fail in the same sample, none waits for the commits of others.
TEST_F(PipelineStorageTest, EventsThatWaitTogetherAreStoredInOneCommit) {
  constexpr int kValves = 100;
  history_.commit_time = milliseconds(40);
  Start();
  for (int v = 0; v < kValves; ++v) {
    Feed(ValveName(v), 0, 50);
  }
  for (std::uint64_t k = 50; k < 80; ++k) {
    for (int v = 0; v < kValves; ++v) {
      Feed(ValveName(v), k, k + 1, kF7Offset);
    }
  }
  ASSERT_TRUE(AwaitEvents(2 * kValves));
  pipeline_->Stop();

  EXPECT_EQ(counters_[Counter::kEventsUnpersisted], 0U);
  EXPECT_EQ(history_.recorded.size(), 2U * kValves);
  for (const auto& [key, count] : history_.recorded) {
    EXPECT_EQ(count, 1);
  }
}

// Evidence of others takes seconds, in pieces.
TEST_F(PipelineStorageTest, AnEventDoesNotWaitForTheEvidenceOfOthers) {
  constexpr int kValves = 60;
  Start();
  for (int v = 0; v < kValves; ++v) {
    OfferEpisode(ValveName(v));
  }
  history_.trace_time = milliseconds(10);
  ASSERT_TRUE(AwaitEvents(2 * kValves));
  OfferEpisode("late");
  ASSERT_TRUE(AwaitEvents(2 * kValves + 2));
  history_.trace_time = milliseconds(0);
  pipeline_->Stop();

  EXPECT_EQ(counters_[Counter::kEventsUnpersisted], 0U);
  EXPECT_EQ(history_.trace_points, 80U * (kValves + 1));
}

// A commit that fails as a whole is repeated as a whole, and nothing doubled.
TEST_F(PipelineStorageTest, ACommitOfManyThatFailsIsRepeated) {
  history_.broken = true;
  Start();
  for (int v = 0; v < 20; ++v) {
    OfferEpisode(ValveName(v));
  }
  ASSERT_TRUE(AwaitEvents(40));
  history_.notice.Apply([&] { history_.broken = false; });
  ASSERT_TRUE(
      history_.notice.Await([&] { return history_.recorded.size() == 40; }));
  pipeline_->Stop();

  for (const auto& [key, count] : history_.recorded) {
    EXPECT_EQ(count, 1);
  }
  EXPECT_EQ(history_.gaps.size(), 1U);
}

TEST_F(PipelineStorageTest, AStuckHistoryHoldsAnEventUpForItsPatienceOnly) {
  options_.journal.patience = milliseconds(50);
  history_.stuck = true;
  Start();
  const auto start = std::chrono::steady_clock::now();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));

  EXPECT_GE(bus_.event_times[0] - start, milliseconds(50));
  EXPECT_FALSE(bus_.events[0].second);
  history_.notice.Apply([&] { history_.stuck = false; });
  pipeline_->Stop();
  EXPECT_EQ(counters_[Counter::kEventsUnpersisted], 2U);
  for (const auto& [key, count] : history_.recorded) {
    EXPECT_EQ(count, 1);
  }
  EXPECT_EQ(history_.recorded.size(), 2U);
}

TEST_F(PipelineStorageTest, ABrokenHistoryStopsNothingAndIsMadeGoodLater) {
  history_.broken = true;
  Start();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  EXPECT_FALSE(bus_.events[0].second);
  EXPECT_TRUE(pipeline_->history_degraded());
  ASSERT_TRUE(bus_.notice.Await([&] { return bus_.decisions.size() == 80; }));

  history_.notice.Apply([&] { history_.broken = false; });
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 1; }));
  pipeline_->Stop();

  EXPECT_FALSE(pipeline_->history_degraded());
  EXPECT_EQ(history_.gaps[0].reason, "persistence_degraded");
  ASSERT_EQ(history_.recorded.size(), 2U);
  for (const auto& [key, count] : history_.recorded) {
    EXPECT_EQ(count, 1);
  }
}

TEST_F(PipelineStorageTest, ARecordThatFailsForItsOwnSakeIsSetAside) {
  history_.poison = "ill";
  Start();
  OfferEpisode("ill");
  OfferEpisode("V1");
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 2; }));
  ASSERT_TRUE(AwaitEvents(4));
  pipeline_->Stop();

  EXPECT_EQ(history_.recorded.size(), 2U);
  EXPECT_FALSE(pipeline_->history_degraded());
  EXPECT_EQ(counters_[Counter::kPersistFailures], 0U);
  EXPECT_EQ(counters_[Counter::kRecordsSetAside], 2U);
  EXPECT_EQ(counters_[Counter::kEventsLost], 2U);
  EXPECT_EQ(counters_[Counter::kEventsUnpersisted], 2U);
  EXPECT_EQ(history_.gaps[0].reason, "record_set_aside");
  EXPECT_EQ(history_.gaps[0].valve_id, "ill");
  EXPECT_THAT(lines_, testing::Contains(
                          "record_set_aside id=M126 record=DETECTED valve=ill "
                          "reason=\"a trigger says no\""));
}

TEST_F(PipelineStorageTest, ARecordThatIsTakenOnceMoreIsNotSetAside) {
  options_.journal.tries = 1000;
  history_.poison = "V1";
  Start();
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  history_.notice.Apply([&] { history_.poison.clear(); });
  ASSERT_TRUE(
      history_.notice.Await([&] { return history_.recorded.size() == 2; }));
  pipeline_->Stop();

  EXPECT_EQ(counters_[Counter::kRecordsSetAside], 0U);
  EXPECT_FALSE(bus_.events[0].second);
}

TEST_F(PipelineStorageTest, AnEventThatTheHistoryRefusesIsNotCalledPersisted) {
  history_.refused = "V1";
  Start();
  OfferEpisode("V1");
  OfferEpisode("V2");
  ASSERT_TRUE(AwaitEvents(4));
  pipeline_->Stop();

  EXPECT_EQ(counters_[Counter::kEventsRefused], 2U);
  EXPECT_EQ(counters_[Counter::kEventsUnpersisted], 2U);
  EXPECT_EQ(std::ranges::count(bus_.events, true,
                               &std::pair<TransitionKind, bool>::second),
            2);
  EXPECT_THAT(
      lines_,
      testing::Contains("event_refused id=M125 valve=V1 transition=DETECTED"));
}

TEST_F(PipelineStorageTest, WhatIsBufferedAndFailsForItsOwnSakeIsDropped) {
  history_.buffer_poisoned = true;
  Start();
  ASSERT_TRUE(history_.notice.Await(
      [&] { return history_.gaps.size() == 2; }));  // Its own, the outage.
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  pipeline_->Stop();

  EXPECT_EQ(history_.recorded.size(), 2U);
  EXPECT_FALSE(pipeline_->history_degraded());
  EXPECT_EQ(counters_[Counter::kRecordsSetAside], 1U);
}

TEST_F(PipelineStorageTest, ACheckpointThatFailsForItsOwnSakeIsDropped) {
  options_.checkpoint_period = milliseconds(1);
  history_.checkpoint_poisoned = true;
  Start();
  Feed("V1", 0, 50);
  pipeline_->Poll(std::chrono::steady_clock::now() + milliseconds(5));
  ASSERT_TRUE(history_.notice.Await(
      [&] { return counters_[Counter::kRecordsSetAside] == 1; }));
  history_.notice.Apply([&] { history_.checkpoint_poisoned = false; });
  Feed("V1", 50, 60);
  pipeline_->Stop();

  ASSERT_EQ(history_.checkpoint_sum.coverage.size(), 1U);
  EXPECT_EQ(history_.checkpoint_sum.coverage[0].samples[Quality::kLive], 10U);
  EXPECT_FALSE(pipeline_->history_degraded());
}

// Those that find no room are stored all the same; the next session sends them.
TEST_F(PipelineStorageTest, EventsThatWaitForTheBusAreBounded) {
  options_.journal.max_records = 10;
  options_.journal.patience = std::chrono::minutes(1);
  history_.stuck = true;
  Start();
  for (int v = 0; v < 20; ++v) {
    OfferEpisode(ValveName(v));
  }
  EXPECT_GE(counters_[Counter::kEventsUnsent], 20U);
  history_.notice.Apply([&] { history_.stuck = false; });
  pipeline_->Stop();
  EXPECT_LE(bus_.events.size(), 12U);
}

TEST_F(PipelineStorageTest, GapsEndNoEarlierThanTheyBeginIfTheClockIsSetBack) {
  std::atomic<std::int64_t> now_ns{1'000'000};
  context_.utc_now_ns = [&now_ns] { return --now_ns; };
  recorder_options_.max_pending = 100;
  history_.broken = true;
  FakeRuns runs;
  runs.broken = true;
  Start(&runs);
  OfferEpisode("V1");
  ASSERT_TRUE(AwaitEvents(2));
  history_.notice.Apply([&] { history_.broken = false; });
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 1; }));
  Feed("V1", 80, 350);
  ASSERT_TRUE(history_.notice.Await(
      [&] { return counters_[Counter::kRecordDropped] == 300; }));
  runs.notice.Apply([&] { runs.broken = false; });
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 2; }));
  Stop();

  for (const DataGap& gap : history_.gaps) {
    EXPECT_LE(gap.from_ns, gap.to_ns) << gap.reason;
  }
}

TEST_F(PipelineStorageTest, StoppingWithABrokenHistoryCountsWhatIsLost) {
  history_.broken = true;
  Start();
  OfferEpisode("V1");
  pipeline_->Stop();

  EXPECT_TRUE(pipeline_->history_degraded());
  EXPECT_EQ(bus_.events.size(), 2U);
  EXPECT_EQ(counters_[Counter::kEventsLost], 2U);
}

TEST_F(PipelineStorageTest, ALosslessRecorderHoldsEverySampleInOrder) {
  recorder_options_.lossless = true;
  recorder_options_.queue_samples = 8;
  FakeRuns runs;
  Start(&runs);
  Feed("V1", 0, 3000);
  pipeline_->OnSample("V1", BadSample(3000), 1);
  pipeline_->OnSample("V1", PlantSample(5), 1);
  pipeline_->OnStreamEnded("V1", 1);
  Stop();

  ASSERT_EQ(runs.stored.size(), 3002U);
  for (std::size_t k = 0; k < 3000; ++k) {
    EXPECT_EQ(runs.stored[k].sample.seq, k);
  }
  EXPECT_TRUE(runs.stored[0].initialised);
  EXPECT_EQ(runs.stored[3000].intake, Intake::kNotFinite);
  EXPECT_EQ(runs.stored[3001].intake, Intake::kLate);
  EXPECT_EQ(runs.ends, 1);
  EXPECT_EQ(counters_[Counter::kRecorded], 3002U);
  EXPECT_EQ(counters_[Counter::kRecordDropped], 0U);
}

TEST_F(PipelineStorageTest, ARecorderThatFallsBehindCountsWhatIsMissing) {
  recorder_options_.queue_samples = 8;
  FakeRuns runs;
  runs.held = true;
  Start(&runs);
  Feed("V1", 0, 1000);
  ASSERT_TRUE(bus_.notice.Await([&] { return bus_.decisions.size() == 1000; }));
  runs.notice.Apply([&] { runs.held = false; });
  Stop();

  EXPECT_GT(counters_[Counter::kRecordDropped], 0U);
  EXPECT_EQ(counters_[Counter::kRecorded], runs.stored.size());
  EXPECT_EQ(counters_[Counter::kRecorded] + counters_[Counter::kRecordDropped],
            1000U);
}

TEST_F(PipelineStorageTest,
       RecordingThatFailsDropsAndCountsWhileDiagnosisGoesOn) {
  recorder_options_.lossless = true;
  recorder_options_.max_pending = 100;
  FakeRuns runs;
  runs.broken = true;
  Start(&runs);
  Feed("V1", 0, 1000);
  Stop();

  EXPECT_EQ(bus_.decisions.size(), 1000U);
  EXPECT_TRUE(recorder_->degraded());
  EXPECT_EQ(counters_[Counter::kRecordDropped], 1000U);
}

TEST_F(PipelineStorageTest,
       RecordingThatResumesLeavesAGapWhereSamplesAreMissing) {
  recorder_options_.max_pending = 100;
  FakeRuns runs;
  runs.broken = true;
  Start(&runs);
  Feed("V1", 0, 150);
  ASSERT_TRUE(history_.notice.Await(
      [&] { return counters_[Counter::kRecordDropped] == 100; }));
  runs.notice.Apply([&] { runs.broken = false; });
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 1; }));
  Feed("V1", 150, 200);
  Stop();

  EXPECT_EQ(history_.gaps.size(), 1U);
  EXPECT_EQ(history_.gaps[0].reason, "record_dropped");
  EXPECT_EQ(history_.gaps[0].valve_id, "");
  EXPECT_FALSE(recorder_->degraded());
  EXPECT_EQ(runs.stored.size(), 100U);
}

}  // namespace
}  // namespace fdi::monitor
