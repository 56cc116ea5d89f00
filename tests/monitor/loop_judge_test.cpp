// The audit of a valve's loop, without a model set and beside one, from its
// samples to the history.
#include "monitor/names/loop_judge.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "monitor/valve_monitor.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "tests/monitor/budget.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"
#include "tests/monitor/test_support.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

using testing::ElementsAre;

// Keeps what a tracker tells.
class LoopOutlet : public FakeOutlet {
 public:
  void OnEvent(FaultEvent event) override {
    kinds.push_back(event.transition.kind);
    events.push_back(std::move(event));
  }
  void OnEvidence(EpisodeTrace trace) override { points += trace.trace.size(); }
  void OnNormal(const std::string& /*valve*/, std::int64_t /*ns*/) override {
    ++normal;
  }

  std::vector<FaultEvent> events;
  std::vector<TransitionKind> kinds;
  std::size_t points{0};
  int normal{0};
};

class LoopJudgeTest : public testing::Test {
 protected:
  LoopJudgeTest() { worker_.Start(); }
  ~LoopJudgeTest() override { worker_.Stop(); }

  static Sample At(std::uint64_t seq, double x_follows) {
    Sample sample;
    sample.seq = seq;
    sample.source_id = 1;
    const auto k = static_cast<double>(seq);
    sample.stamp_ns =
        (1'700'000'000 + static_cast<std::int64_t>(seq) * 10) * kSecond;
    const double cv = 50.0 + 10.0 * std::sin(0.02 * k);
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kX, 50.0 + x_follows * (cv - 50.0));
    return sample;
  }
  // Samples [from, to), each once the answers to those before are there.
  void Feed(std::uint64_t from, std::uint64_t to, double x_follows) {
    for (std::uint64_t k = from; k < to; ++k) {
      Give(At(k, x_follows));
    }
  }
  void Give(const Sample& sample) {
    const ValveOutcome outcome = valve_.Step(sample, 1, now_, outlet_);
    last_ = outcome.verdict;
    models_ = outcome.models;
    while (worker_.busy()) {
      std::this_thread::yield();
    }
  }

  AuditWorker worker_{true};
  ValveMonitor::TimePoint now_{};
  LoopOutlet outlet_;
  std::shared_ptr<AlarmGate> gate_ = std::make_shared<AlarmGate>();
  ValveMonitor valve_{"V1",
                      std::nullopt,
                      {},
                      nullptr,
                      std::make_shared<const SeverityCatalogue>(),
                      &worker_,
                      gate_};
  Verdict last_;
  const ModelSet* models_{nullptr};
};

TEST_F(LoopJudgeTest, ALoopThatIsSoundIsJudgedAndNormal) {
  Feed(1, 720, 1.0);
  EXPECT_EQ(models_, nullptr);
  EXPECT_EQ(last_.quality, Quality::kUnassigned);

  Feed(720, 1100, 1.0);
  ASSERT_NE(models_, nullptr);
  EXPECT_EQ(models_->name, "audit");
  EXPECT_EQ(last_.quality, Quality::kLive);
  EXPECT_EQ(outlet_.normal, 1);
  EXPECT_TRUE(outlet_.events.empty());
}

TEST_F(LoopJudgeTest, ARodThatStandsIsAnEpisodeWithItsEvidence) {
  Feed(1, 1100, 0.0);

  ASSERT_THAT(outlet_.kinds, ElementsAre(TransitionKind::kDetected,
                                         TransitionKind::kIsolated));
  const FaultEvent& named = outlet_.events[1];
  EXPECT_EQ(named.model_set, "audit");
  ASSERT_EQ(named.candidates.size(), 1U);
  EXPECT_EQ(named.candidates[0].fault, kNoResponse);
  EXPECT_TRUE(named.candidates[0].isolated);
  EXPECT_GE(outlet_.points, LoopWatch::kPoints);
  EXPECT_TRUE(valve_.episode_open());

  storage::TemporaryDirectory directory;
  storage::HistoryWriter writer(directory.path() / "history.db");
  writer.CommitBatch([&] {
    for (const FaultEvent& event : outlet_.events) {
      writer.Record(event, event.transition.stamp_ns);
    }
  });
  const auto episodes =
      storage::HistoryReader(directory.path() / "history.db").List();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].fault, "no_response");
  EXPECT_EQ(episodes[0].layer, "audit");
  EXPECT_EQ(writer.OpenEpisodes().at(0).layer, Layer::kAudit);
}

TEST_F(LoopJudgeTest, ItsEpisodeEndsWithTheStreamAndWithAModelSet) {
  Feed(1, 1100, 0.0);
  EXPECT_FALSE(valve_.Adopt(std::nullopt, outlet_));  // As it was.
  ASSERT_TRUE(valve_.EndStream(1, outlet_));
  ASSERT_EQ(outlet_.kinds.size(), 3U);
  EXPECT_EQ(outlet_.kinds[2], TransitionKind::kClosed);
  EXPECT_EQ(outlet_.events[2].transition.reason, EndReason::kStreamEnded);
  EXPECT_FALSE(valve_.episode_open());
}

// Its evidence is complete after ten minutes, and it lasts for hours.
TEST_F(LoopJudgeTest, ANoticeIsRaisedOnceItHasLasted) {
  const auto audit = AuditModels(LoopWatch::kInterval_s);
  gate_->Set(Budget(8766.0, audit->content_hash, 0, 1));
  Feed(1, 1100, 0.0);
  EXPECT_THAT(outlet_.kinds, ElementsAre(TransitionKind::kDetected,
                                         TransitionKind::kIsolated));
  EXPECT_TRUE(outlet_.events.back().transition.notice);
  Feed(1100, 3500, 0.0);
  EXPECT_EQ(outlet_.kinds.back(), TransitionKind::kRaised);
}

// Beside the observers of a valve whose X is CV.
class AuditBesideModelsTest : public LoopJudgeTest {
 protected:
  AuditBesideModelsTest() { valve_.Adopt(SlowModels(), outlet_); }
  static EngineParts SlowModels() {
    ModelSet models = LinearModels();
    models.sample_period_s = 10.0;
    return EngineParts(std::make_shared<const ModelSet>(models));
  }
  // X through a play of 2 %, which is within the observers' limits, and off.
  void FeedSticky(std::uint64_t from, std::uint64_t to, double off = 0.0) {
    for (std::uint64_t k = from; k < to; ++k) {
      Sample sample = At(k, 1.0);
      const double cv = sample[Signal::kCv];
      rod_ = std::clamp(rod_, cv - 1.0, cv + 1.0);
      sample.Set(Signal::kX, rod_ + off);
      Give(sample);
    }
  }

 private:
  double rod_{50.0};
};

TEST_F(AuditBesideModelsTest, TellsWhatTheObserversDoNotSee) {
  FeedSticky(1, 1100);
  ASSERT_THAT(outlet_.kinds, ElementsAre(TransitionKind::kDetected,
                                         TransitionKind::kIsolated));
  EXPECT_EQ(outlet_.events[1].model_set, "audit");
  EXPECT_EQ(outlet_.events[1].transition.layer, Layer::kAudit);
  EXPECT_EQ(outlet_.events[1].candidates.at(0).fault, kStiction);
  EXPECT_GE(outlet_.points, LoopWatch::kPoints);
  EXPECT_TRUE(valve_.episode_open());
  // The decision vector is that of the model set, and nothing is said to be
  // normal.
  EXPECT_EQ(models_->name, "linear");
  EXPECT_EQ(last_.quality, Quality::kLive);
  EXPECT_EQ(last_.state, State::kNormal);
  EXPECT_EQ(outlet_.normal, 1);  // Before it was found.

  // One alarm of one valve: the observers' takes its place.
  FeedSticky(1100, 1140, kF7Offset);
  ASSERT_EQ(outlet_.kinds.size(), 5U);
  EXPECT_EQ(outlet_.kinds[2], TransitionKind::kClosed);
  EXPECT_EQ(outlet_.events[2].transition.reason, EndReason::kSuperseded);
  EXPECT_EQ(outlet_.events[2].episode_id, outlet_.events[1].episode_id);
  EXPECT_EQ(outlet_.kinds[3], TransitionKind::kDetected);
  EXPECT_EQ(outlet_.events[3].model_set, "linear");
  EXPECT_EQ(outlet_.kinds[4], TransitionKind::kIsolated);
}

// The observers go on beside it, and their models are not those of its name.
TEST_F(AuditBesideModelsTest, ANoticeIsRaisedAsWhatTheAuditFound) {
  gate_->Set(Budget(8766.0, 0x1234, 0, 1));
  FeedSticky(1, 3500);
  ASSERT_THAT(outlet_.kinds,
              ElementsAre(TransitionKind::kDetected, TransitionKind::kIsolated,
                          TransitionKind::kRaised));
  EXPECT_TRUE(outlet_.events[1].transition.notice);
  const FaultEvent& raised = outlet_.events[2];
  EXPECT_FALSE(raised.transition.notice);
  EXPECT_EQ(raised.model_set, "audit");
  EXPECT_EQ(raised.model_hash, outlet_.events[1].model_hash);
  EXPECT_EQ(raised.models->faults, outlet_.events[1].models->faults);
  EXPECT_EQ(raised.transition.share, 0.0);
}

TEST_F(AuditBesideModelsTest, WhatTakesThePlaceOfAnAlarmIsOne) {
  FeedSticky(1, 1100);  // Without a budget yet.
  gate_->Set(Budget(8766.0));
  FeedSticky(1100, 1110, -7.0);
  ASSERT_GE(outlet_.kinds.size(), 4U);
  EXPECT_EQ(outlet_.events[2].transition.reason, EndReason::kSuperseded);
  EXPECT_EQ(outlet_.kinds[3], TransitionKind::kDetected);
  EXPECT_FALSE(outlet_.events[3].transition.notice);
  FeedSticky(1110, 1414);
  ASSERT_EQ(outlet_.kinds.back(), TransitionKind::kClosed);
  FeedSticky(1414, 1424, -7.0);  // CV falls, as at 1100.
  EXPECT_NE(outlet_.kinds.back(), TransitionKind::kClosed);
  EXPECT_TRUE(outlet_.events.back().transition.notice);
}

// The observers know what is normal for the valve, the audit does not.
TEST_F(AuditBesideModelsTest, LeavesTheValveAloneUnlessItIsToTellOfAll) {
  AuditWorker others;
  others.Start();
  ValveMonitor valve("V1", SlowModels(), {}, nullptr,
                     std::make_shared<const SeverityCatalogue>(), &others);
  std::swap(valve, valve_);
  FeedSticky(1, 1100);
  EXPECT_TRUE(outlet_.events.empty());
  std::swap(valve, valve_);
  others.Stop();
}

TEST_F(AuditBesideModelsTest, SaysNothingWhileTheObserversFindAFault) {
  Feed(1, 1300, 0.0);  // A rod that stands.
  ASSERT_FALSE(outlet_.events.empty());
  for (const FaultEvent& event : outlet_.events) {
    EXPECT_EQ(event.model_set, "linear");
  }
}

// As after a restart of the monitor: the audit has to judge the loop again.
TEST_F(AuditBesideModelsTest, WhatItFoundOnlyItFindsNormal) {
  OpenEpisode left;
  left.valve_id = "V1";
  left.source_id = 1;
  left.detection_stamp_ns = At(1, 1.0).stamp_ns;
  left.episode_id = EpisodeId("V1", 1, left.detection_stamp_ns);
  left.last_stamp_ns = At(5, 1.0).stamp_ns;
  left.layer = Layer::kAudit;
  left.model_hash = AuditModels(LoopWatch::kInterval_s)->content_hash;
  valve_.Recover(left);
  Feed(6, 700, 1.0);
  ASSERT_EQ(outlet_.events.size(), 1U);
  EXPECT_EQ(outlet_.events[0].transition.reason, EndReason::kUnknown);
  EXPECT_EQ(outlet_.normal, 0);
  Feed(700, 1100, 1.0);
  EXPECT_GE(outlet_.normal, 1);
}

// Windows beyond the capacity are refused, and the loop asks again.
TEST(AuditWorkerTest, AFewWindowsMayWait) {
  AuditWorker worker;
  std::vector<std::future<std::optional<loop::Audit>>> answers;
  loop::Window window;
  window.op = window.pv = std::vector<double>(60, 1.0);
  while (worker.has_room()) {
    answers.push_back(worker.Submit(window));
  }
  EXPECT_EQ(answers.size(), AuditWorker::kCapacity);
  window.pv.pop_back();  // Cannot be audited.
  answers.push_back(worker.Submit(window));
  worker.Start();
  EXPECT_FALSE(answers.back().get());
  EXPECT_TRUE(answers.front().get());
  worker.Stop();
  EXPECT_FALSE(worker.Submit(window).get());
}

}  // namespace
}  // namespace fdi::monitor
