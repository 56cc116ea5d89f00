#include "monitor/pipeline.h"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

std::string ValveName(int v) {
  std::string name("V");
  return name += std::to_string(v);
}

class PipelineTest : public testing::Test {
 protected:
  PipelineTest() {
    options_.history.utc_now_ns = [] { return std::int64_t{1'000}; };
    options_.history.retry_period = milliseconds(20);
    options_.history.commit_period = milliseconds(20);
    options_.recorder.commit_period = milliseconds(20);
  }

  void Start(SampleSink* samples = nullptr) {
    pipeline_ = std::make_unique<Pipeline>(
        options_, PipelineSinks{bus_, bus_, history_, samples},
        std::make_shared<FixedResolver>(SharedLinearModels()), counters_, log_);
    pipeline_->Start({});
  }
  void Offer(const std::string& valve, std::uint64_t from, std::uint64_t to,
             double offset = 0.0) {
    for (std::uint64_t k = from; k < to; ++k) {
      ASSERT_TRUE(pipeline_->Offer(valve, PlantSample(k, offset), 1));
    }
  }
  void OfferEpisode(const std::string& valve) {
    Offer(valve, 0, 50);
    Offer(valve, 50, 80, kF7Offset);
  }
  bool AwaitEvents(std::size_t count) {
    return bus_.notice.Await([&] { return bus_.events.size() >= count; });
  }

  PipelineOptions options_;
  FakeBus bus_;
  FakeHistory history_;
  Counters counters_;
  std::vector<std::string> lines_;
  ThrottledLog log_{[this](LogLevel, std::string_view line) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    lines_.emplace_back(line);
  }};
  std::unique_ptr<Pipeline> pipeline_;
};

TEST_F(PipelineTest, EverySampleInOrderGivesOneDecision) {
  Start();
  for (std::uint64_t k = 0; k < 1000; ++k) {
    for (const char* valve : {"V1", "V2", "bare1"}) {
      pipeline_->Offer(valve, PlantSample(k), 1);
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
  Offer("V1", 0, 10);
  pipeline_->Offer("V1", BadSample(10), 1);
  Sample far = PlantSample(11);
  far.Set(Signal::kX, 1e6);
  pipeline_->Offer("V1", far, 1);
  pipeline_->Offer("V1", PlantSample(11), 1);
  pipeline_->Offer("V1", PlantSample(3), 1);
  pipeline_->Offer("", PlantSample(0), 1);
  pipeline_->Offer(std::string(65, 'x'), PlantSample(0), 1);
  Offer("V1", 12, 20);
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

TEST_F(PipelineTest, ValvesBeyondTheLimitAreCountedNotServed) {
  options_.max_valves = 2;
  options_.valve_glob = "V*";
  Start();
  for (const char* valve : {"V1", "V2", "V3", "V4", "V4", "W1", "V1"}) {
    pipeline_->Offer(valve, PlantSample(counters_[Counter::kReceived]), 1);
  }
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 3U);
  EXPECT_EQ(counters_[Counter::kRefusedSamples], 3U);
  EXPECT_EQ(counters_[Counter::kFilteredSamples], 1U);
}

TEST_F(PipelineTest, AModelSetThatCannotBeHadLeavesTheValveUnassigned) {
  Start();
  Offer("broken1", 0, 5);
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 5U);
  EXPECT_EQ(counters_[Counter::kModelFailures], 1U);
}

TEST_F(PipelineTest, AFullQueueMakesTheIntakeWaitAndDropsNothing) {
  options_.queue_samples = 16;
  bus_.held = true;
  Start();
  std::atomic<int> offered{0};
  std::thread intake([&] {
    for (std::uint64_t k = 0; k < 500; ++k) {
      pipeline_->Offer("V1", PlantSample(k), 1);
      bus_.notice.Apply([&] { ++offered; });
    }
  });

  // One batch at the diagnosis, one in the queue, one at the door.
  ASSERT_TRUE(bus_.notice.Await(
      [&] { return pipeline_->backlog().diagnosis == 16 || offered > 33; }));
  EXPECT_LE(offered, 33);
  bus_.notice.Apply([&] { bus_.held = false; });
  intake.join();
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 500U);
}

TEST_F(PipelineTest, ASwapUnderLoadNeitherLosesNorRepeatsASample) {
  Start();
  std::thread intake([&] { Offer("V1", 0, 20'000); });
  const auto seen = [&](std::size_t count) {
    return bus_.notice.Await([&] { return bus_.decisions.size() >= count; });
  };
  ASSERT_TRUE(seen(2000));
  pipeline_->Reassign(
      std::make_shared<FixedResolver>(SharedLinearModels(0x99)));
  intake.join();
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

TEST_F(PipelineTest, AnEventIsStoredBeforeItIsPublished) {
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

// Of valves that fail in the same sample none waits for the commits of others.
TEST_F(PipelineTest, EventsThatWaitTogetherAreStoredInOneCommit) {
  constexpr int kValves = 100;
  history_.commit_time = milliseconds(40);
  Start();
  for (int v = 0; v < kValves; ++v) {
    Offer(ValveName(v), 0, 50);
  }
  for (std::uint64_t k = 50; k < 80; ++k) {
    for (int v = 0; v < kValves; ++v) {
      Offer(ValveName(v), k, k + 1, kF7Offset);
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

// A commit that fails as a whole is repeated as a whole, and nothing doubled.
TEST_F(PipelineTest, ACommitOfManyThatFailsIsRepeated) {
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

TEST_F(PipelineTest, AStuckHistoryHoldsAnEventUpForItsPatienceOnly) {
  options_.history.patience = milliseconds(50);
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

TEST_F(PipelineTest, ABrokenHistoryStopsNothingAndIsMadeGoodLater) {
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

TEST_F(PipelineTest, StoppingWithABrokenHistoryCountsWhatIsLost) {
  history_.broken = true;
  Start();
  OfferEpisode("V1");
  pipeline_->Stop();

  EXPECT_TRUE(pipeline_->history_degraded());
  EXPECT_EQ(bus_.events.size(), 2U);
  EXPECT_EQ(counters_[Counter::kEventsLost], 2U);
}

TEST_F(PipelineTest, ALosslessRecorderHoldsEverySampleInOrder) {
  options_.recorder.lossless = true;
  options_.recorder.queue_samples = 8;
  FakeRuns runs;
  Start(&runs);
  Offer("V1", 0, 3000);
  pipeline_->Offer("V1", BadSample(3000), 1);
  pipeline_->Offer("V1", PlantSample(5), 1);
  pipeline_->OfferEnd("V1", 1);
  pipeline_->Stop();

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

TEST_F(PipelineTest, ARecorderThatFallsBehindCountsWhatIsMissing) {
  options_.recorder.queue_samples = 8;
  FakeRuns runs;
  runs.held = true;
  Start(&runs);
  Offer("V1", 0, 1000);
  ASSERT_TRUE(bus_.notice.Await([&] { return bus_.decisions.size() == 1000; }));
  runs.notice.Apply([&] { runs.held = false; });
  pipeline_->Stop();

  EXPECT_GT(counters_[Counter::kRecordDropped], 0U);
  EXPECT_EQ(counters_[Counter::kRecorded], runs.stored.size());
  EXPECT_EQ(counters_[Counter::kRecorded] + counters_[Counter::kRecordDropped],
            1000U);
}

TEST_F(PipelineTest, RecordingThatFailsDropsAndCountsWhileDiagnosisGoesOn) {
  options_.recorder.lossless = true;
  options_.recorder.max_pending = 100;
  FakeRuns runs;
  runs.broken = true;
  Start(&runs);
  Offer("V1", 0, 1000);
  pipeline_->Stop();

  EXPECT_EQ(bus_.decisions.size(), 1000U);
  EXPECT_TRUE(pipeline_->recording_degraded());
  EXPECT_EQ(counters_[Counter::kRecordDropped], 1000U);
}

TEST_F(PipelineTest, RecordingThatResumesLeavesAGapWhereSamplesAreMissing) {
  options_.recorder.max_pending = 100;
  FakeRuns runs;
  runs.broken = true;
  Start(&runs);
  Offer("V1", 0, 150);
  ASSERT_TRUE(history_.notice.Await(
      [&] { return counters_[Counter::kRecordDropped] == 100; }));
  runs.notice.Apply([&] { runs.broken = false; });
  ASSERT_TRUE(history_.notice.Await([&] { return history_.gaps.size() == 1; }));
  Offer("V1", 150, 200);
  pipeline_->Stop();

  EXPECT_EQ(history_.gaps.size(), 1U);
  EXPECT_EQ(history_.gaps[0].reason, "record_dropped");
  EXPECT_EQ(history_.gaps[0].valve_id, "");
  EXPECT_FALSE(pipeline_->recording_degraded());
  EXPECT_EQ(runs.stored.size(), 100U);
}

TEST_F(PipelineTest, AnOpenEpisodeOfAValveThatStaysSilentIsClosedUnknown) {
  options_.registry.recovery_window = milliseconds(0);
  pipeline_ = std::make_unique<Pipeline>(
      options_, PipelineSinks{bus_, bus_, history_, nullptr},
      std::make_shared<FixedResolver>(SharedLinearModels()), counters_, log_);
  OpenEpisode open;
  open.valve_id = "gone";
  open.episode_id = 42;
  pipeline_->Start({open});
  ASSERT_TRUE(AwaitEvents(1));
  pipeline_->Stop();

  EXPECT_EQ(bus_.events[0].first, TransitionKind::kClosed);
  EXPECT_EQ(history_.gaps.at(0).reason, "monitor_down");
}

TEST_F(PipelineTest, EveryCounterHasANameOfItsOwn) {
  std::vector<std::string> names;
  for (const auto& [name, total] : counters_.Snapshot()) {
    EXPECT_LE(name.size(), 32U);
    names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end());
}

}  // namespace
}  // namespace fdi::monitor
