#include "monitor/valve_monitor.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "monitor/episode_tracker.h"
#include "tests/monitor/budget.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {
namespace {

using std::chrono::seconds;
using testing::Contains;
using testing::ElementsAre;

class Notebook : public EpisodeOutlet {
 public:
  void OnEvent(FaultEvent event) override {
    events.push_back(std::move(event));
  }
  void OnEvidence(EpisodeTrace trace) override {
    complete = complete || trace.complete;
    for (TracePoint& point : trace.trace.Unpack()) {
      evidence.emplace_back(trace.episode_id, std::move(point));
    }
  }
  void OnLook(EpisodeLook /*look*/) override {}
  void OnStrength(StrengthPoint point) override { strengths.push_back(point); }
  void OnGap(DataGap gap) override { gaps.push_back(std::move(gap)); }
  void OnNormal(const std::string& /*valve*/, std::int64_t stamp_ns) override {
    normal.push_back(stamp_ns);
  }
  void OnSilence(const std::string& /*valve*/,
                 std::optional<std::int64_t> since_ns) override {
    silences.push_back(since_ns);
  }
  void OnResumed(const OpenEpisode& episode, std::int64_t /*stamp*/) override {
    resumed.push_back(episode.episode_id);
  }

  std::vector<TransitionKind> Kinds() const {
    std::vector<TransitionKind> kinds;
    for (const FaultEvent& event : events) {
      kinds.push_back(event.transition.kind);
    }
    return kinds;
  }

  std::vector<FaultEvent> events;
  std::vector<std::pair<std::uint64_t, TracePoint>> evidence;
  std::vector<StrengthPoint> strengths;
  std::vector<DataGap> gaps;
  std::vector<std::int64_t> normal;
  std::vector<std::optional<std::int64_t>> silences;
  std::vector<std::uint64_t> resumed;
  bool complete{false};
};

class ValveMonitorTest : public testing::Test {
 protected:
  static constexpr std::uint64_t kWriter = 77;
  static constexpr double kSecond = 1e9;

  ValveOutcome Feed(const Sample& sample, std::uint64_t writer = kWriter) {
    return valve_.Step(sample, writer, now_, notebook_);
  }
  // Samples [from, to) with X off by `offset`.
  void Feed(std::uint64_t from, std::uint64_t to, double offset = 0.0,
            std::uint64_t source = 1) {
    for (std::uint64_t k = from; k < to; ++k) {
      Feed(PlantSample(k, offset, source));
    }
  }
  OpenEpisode LeftOpen() const {
    OpenEpisode episode;
    episode.valve_id = "V1";
    episode.source_id = 1;
    episode.detection_stamp_ns = PlantSample(100).stamp_ns;
    episode.episode_id = EpisodeId("V1", 1, episode.detection_stamp_ns);
    episode.last_stamp_ns = PlantSample(120).stamp_ns;
    episode.isolated = true;
    episode.faults = 0b10;
    episode.candidates = {{7, 1.0, 1.0, true}};
    episode.model_hash = 0x1234;
    return episode;
  }

  ValveMonitor::TimePoint now_{};
  Notebook notebook_;
  ValveMonitor valve_{"V1", EngineParts(SharedLinearModels()), {}};
};

TEST_F(ValveMonitorTest, AFaultIsDetectedIsolatedAndClearedAsOneEpisode) {
  Feed(0, 100);
  Feed(100, 150, kF7Offset);
  Feed(150, 200);

  EXPECT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kIsolated,
                          TransitionKind::kCleared, TransitionKind::kClosed));
  const std::uint64_t id = EpisodeId("V1", 1, PlantSample(100).stamp_ns);
  for (const FaultEvent& event : notebook_.events) {
    EXPECT_EQ(event.episode_id, id);
  }
  ASSERT_FALSE(notebook_.events.at(1).candidates.empty());
  EXPECT_EQ(notebook_.events.at(1).candidates.front().fault, 7);
  EXPECT_TRUE(notebook_.events.at(1).candidates.front().isolated);
  EXPECT_EQ(notebook_.events[3].transition.reason, EndReason::kCleared);
}

class AlarmGateTest : public ValveMonitorTest {
 protected:
  std::vector<bool> Notices() const {
    std::vector<bool> notices;
    for (const FaultEvent& event : notebook_.events) {
      notices.push_back(event.transition.notice);
    }
    return notices;
  }

  std::shared_ptr<AlarmGate> gate_ = std::make_shared<AlarmGate>();
  ValveMonitor gated_{
      "V1",    EngineParts(SharedLinearModels()),           {},
      nullptr, std::make_shared<const SeverityCatalogue>(), nullptr,
      gate_};

  // X is off by `offset`; the limit is 5.
  ValveOutcome Gated(std::uint64_t from, std::uint64_t to, double offset) {
    for (std::uint64_t k = from; k + 1 < to; ++k) {
      gated_.Step(PlantSample(k, offset), kWriter, now_, notebook_);
    }
    return gated_.Step(PlantSample(to - 1, offset), kWriter, now_, notebook_);
  }
};

// A share of 1.2 comes in some 3000 h, one of 4 never.
TEST_F(AlarmGateTest, ANoticeIsRaisedOnceItIsRareEnough) {
  gate_->Set(Budget(8766.0));
  EXPECT_FALSE(Gated(0, 100, 0.0).notice);
  EXPECT_TRUE(Gated(100, 104, -6.0).notice);
  ASSERT_THAT(notebook_.Kinds(), ElementsAre(TransitionKind::kDetected));
  EXPECT_TRUE(notebook_.events[0].transition.notice);
  ASSERT_TRUE(notebook_.events[0].transition.return_hours);
  EXPECT_GT(*notebook_.events[0].transition.return_hours, 300.0);
  EXPECT_LT(*notebook_.events[0].transition.return_hours, 12'000.0);

  // Its name may come before, and is then that of the notice.
  EXPECT_FALSE(Gated(104, 140, kF7Offset).notice);
  const auto raised = std::ranges::find(
      notebook_.events, TransitionKind::kRaised,
      [](const FaultEvent& event) { return event.transition.kind; });
  ASSERT_NE(raised, notebook_.events.end());
  EXPECT_EQ(raised->episode_id, notebook_.events[0].episode_id);
  EXPECT_EQ(raised->transition.return_hours, 12'000.0);
  EXPECT_EQ(raised->transition.detection_stamp_ns, PlantSample(100).stamp_ns);
  for (auto event = notebook_.events.begin(); event != notebook_.events.end();
       ++event) {
    EXPECT_EQ(event->transition.notice, event < raised);
  }

  EXPECT_FALSE(Gated(140, 200, 0.0).notice);
  EXPECT_EQ(notebook_.Kinds().back(), TransitionKind::kClosed);
  EXPECT_FALSE(notebook_.events.back().transition.notice);
  EXPECT_NEAR(notebook_.events.back().transition.share, 4.0, 1e-9);
}

// A share of 1.2 comes in some 3000 h, and one hour of its kind after another
// in a seventh of them: nothing grows but the time that it lasts.
TEST_F(AlarmGateTest, ANoticeThatLastsIsRaisedWithoutAnotherMaximum) {
  constexpr std::uint64_t kHour = 3600;
  gate_->Set(Budget(2000.0));
  Gated(0, 100, 0.0);
  EXPECT_TRUE(Gated(100, 100 + kHour - 10, -6.0).notice);
  EXPECT_FALSE(Gated(100 + kHour - 10, 100 + 4 * kHour, -6.0).notice);
  EXPECT_THAT(notebook_.Kinds(), Contains(TransitionKind::kRaised).Times(1));
  for (const FaultEvent& event : notebook_.events) {
    EXPECT_NEAR(event.transition.share, 1.2, 1e-9);
    EXPECT_EQ(event.transition.notice,
              event.transition.kind != TransitionKind::kRaised);
  }
}

TEST_F(AlarmGateTest, AStrongFaultIsAnAlarmAtOnce) {
  gate_->Set(Budget(8766.0));
  Gated(0, 100, 0.0);
  EXPECT_FALSE(Gated(100, 140, kF7Offset).notice);
  EXPECT_THAT(notebook_.Kinds(), ElementsAre(TransitionKind::kDetected,
                                             TransitionKind::kIsolated));
  EXPECT_THAT(Notices(), ElementsAre(false, false));
}

TEST_F(AlarmGateTest, ANoticeThatGoesWasNoAlarm) {
  gate_->Set(Budget(8766.0));
  Gated(0, 100, 0.0);
  Gated(100, 104, -6.0);
  Gated(104, 150, 0.0);
  EXPECT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kCleared,
                          TransitionKind::kClosed));
  EXPECT_THAT(Notices(), ElementsAre(true, true, true));
}

TEST_F(AlarmGateTest, WithoutABudgetOrItsHoursEveryEpisodeIsAnAlarm) {
  Gated(0, 100, 0.0);
  EXPECT_FALSE(Gated(100, 104, -6.0).notice);
  EXPECT_FALSE(notebook_.events[0].transition.return_hours);
  EXPECT_NEAR(notebook_.events[0].transition.share, 1.2, 1e-9);
  Gated(104, 150, 0.0);
  notebook_.events.clear();
  gate_->Set(std::make_shared<const AlarmBudget>(
      8766.0,
      std::vector<HealthyHours>{{.valve_id = "V1", .model_hash = 0x1234}}));
  EXPECT_FALSE(Gated(150, 154, -6.0).notice);
  EXPECT_THAT(notebook_.Kinds(), ElementsAre(TransitionKind::kDetected));
  EXPECT_THAT(Notices(), ElementsAre(false));
}

TEST_F(AlarmGateTest, AResumedNoticeStaysOne) {
  gate_->Set(Budget(8766.0));
  OpenEpisode left = LeftOpen();
  left.isolated = false;
  left.faults = 0;
  left.candidates.clear();
  left.notice = true;
  left.share = 1.25;
  gated_.Recover(left);
  EXPECT_TRUE(Gated(200, 220, -6.0).notice);
  EXPECT_THAT(notebook_.resumed, ElementsAre(left.episode_id));
  EXPECT_FALSE(Gated(220, 240, kF7Offset).notice);
  EXPECT_THAT(notebook_.Kinds(), Contains(TransitionKind::kRaised));
  for (const FaultEvent& event : notebook_.events) {
    EXPECT_EQ(event.episode_id, left.episode_id);
  }
}

// After a swap the hours are of the old set until they are read anew.
TEST_F(AlarmGateTest, TheHoursOfOtherModelsOrEquipmentMakeNoNotice) {
  gate_->Set(Budget(8766.0, 0x4321));
  Gated(0, 100, 0.0);
  EXPECT_FALSE(Gated(100, 104, -6.0).notice);
  Gated(104, 150, 0.0);
  gate_->Set(Budget(8766.0, 0x1234, 1));
  EXPECT_FALSE(Gated(150, 154, -6.0).notice);
  for (const FaultEvent& event : notebook_.events) {
    EXPECT_FALSE(event.transition.notice);
    EXPECT_FALSE(event.transition.return_hours);
  }
}

// A look began it, so it counts among the looks, whose number makes the next
// one common; weighed it is by all that it shows.
TEST_F(AlarmGateTest, AnEpisodeCountsAsWhatItBeganAs) {
  EpisodeTracker tracker("V1", {}, gate_);
  const auto models = SharedLinearModels();
  gate_->Set(Budget(8766.0, 0x1234, 0, 2));
  Verdict verdict;
  const auto step = [&](std::uint64_t k, double share) {
    const Sample sample = PlantSample(k);
    verdict.stamp_ns = sample.stamp_ns;
    verdict.source_id = sample.source_id;
    verdict.share = share;
    tracker.Advance(sample, verdict, *models, notebook_);
    tracker.Step(sample, verdict, models, notebook_);
  };
  verdict.transitions[0].kind = TransitionKind::kDetected;
  verdict.transitions[0].detection_stamp_ns = PlantSample(0).stamp_ns;
  verdict.transition_count = 1;
  step(0, 0.7);
  EXPECT_TRUE(tracker.notice());
  verdict.transition_count = 0;
  step(1, 4.0);
  EXPECT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kRaised));
  for (const FaultEvent& event : notebook_.events) {
    EXPECT_EQ(event.transition.share, 0.7);
  }
}

// From 0.8 on, by 0.08 in a thousand seconds.
TEST_F(ValveMonitorTest, AGrowingFaultIsOneEpisodeWhoseStrengthsAreNoted) {
  Feed(0, 100);
  for (std::uint64_t k = 100; k < 2400; ++k) {
    Feed(PlantSample(k, kF7Offset * (0.8 + 8e-5 * static_cast<double>(k))));
  }
  EXPECT_THAT(notebook_.Kinds(), ElementsAre(TransitionKind::kDetected,
                                             TransitionKind::kIsolated));
  // Five at their times, and others where it has moved by 0.02.
  ASSERT_GE(notebook_.strengths.size(), 8U);
  ASSERT_LE(notebook_.strengths.size(), 14U);
  for (const StrengthPoint& p : notebook_.strengths) {
    EXPECT_EQ(p.episode_id, notebook_.events[0].episode_id);
    EXPECT_EQ(p.fault, 7);
    const auto k =
        static_cast<double>(p.stamp_ns - PlantSample(0).stamp_ns) / kSecond;
    EXPECT_NEAR(p.strength, 0.8 + 8e-5 * k, 0.01);
    EXPECT_LE(p.lowest, 0.8 + 8e-5 * k);
    EXPECT_GE(p.highest, 0.8 + 8e-5 * k);
  }
  notebook_.strengths.clear();
  Feed(2400, 2420);
  Feed(2420, 4000);
  EXPECT_TRUE(notebook_.strengths.empty());
}

TEST_F(ValveMonitorTest, AnEpisodeWithoutANameKeepsWhatCouldExplainItLast) {
  Feed(0, 100);
  Feed(100, 103, kF7Offset);
  Feed(103, 200);
  ASSERT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kCleared,
                          TransitionKind::kClosed));
  ASSERT_EQ(notebook_.events[2].candidates.size(), 1U);
  EXPECT_EQ(notebook_.events[2].candidates[0].fault, 7);
  EXPECT_FALSE(notebook_.events[2].candidates[0].isolated);

  notebook_.events.clear();
  Feed(200, 250, 45.0);  // Like no fault there is.
  Feed(250, 300);
  ASSERT_EQ(notebook_.events.size(), 3U);
  EXPECT_THAT(notebook_.events[2].candidates, testing::IsEmpty());
}

TEST_F(ValveMonitorTest, EvidenceRunsFromBeforeDetectionToTheEndWithoutHoles) {
  Feed(0, 100);
  Feed(100, 150, kF7Offset);
  Feed(150, 200);

  ASSERT_TRUE(notebook_.complete);
  const std::uint64_t last =
      notebook_.evidence.back().second.sample.seq;  // the clearing sample
  ASSERT_EQ(notebook_.evidence.size(), last + 1);
  for (std::size_t k = 0; k < notebook_.evidence.size(); ++k) {
    EXPECT_EQ(notebook_.evidence[k].second.sample.seq, k);
  }
  EXPECT_EQ(PlantSample(last).stamp_ns,
            notebook_.events.back().transition.stamp_ns);
}

// Less is kept from before than waits to be written.
TEST_F(ValveMonitorTest, EvidenceAfterADetectionIsWholeHoweverLittleIsKept) {
  TraceOptions options;
  options.before_s = 3.0;
  ValveMonitor valve("V1", EngineParts(SharedLinearModels()), options);
  for (std::uint64_t k = 0; k < 200; ++k) {
    const double offset = k < 100 || k >= 150 ? 0.0 : kF7Offset;
    valve.Step(PlantSample(k, offset), kWriter, now_, notebook_);
  }

  ASSERT_TRUE(notebook_.complete);
  const std::int64_t detected = notebook_.events.front().transition.stamp_ns;
  const auto& evidence = notebook_.evidence;
  const std::int64_t first = evidence.front().second.sample.stamp_ns;
  EXPECT_LT(first, detected);
  EXPECT_GE(first, detected - 3'000'000'000);
  for (std::size_t k = 1; k < evidence.size(); ++k) {
    EXPECT_EQ(evidence[k].second.sample.seq,
              evidence[k - 1].second.sample.seq + 1);
  }
}

TEST_F(ValveMonitorTest, EvidenceEndsTenMinutesAfterIsolation) {
  Feed(0, 100);
  Feed(100, 1500, kF7Offset);

  ASSERT_TRUE(notebook_.complete);
  const std::int64_t isolated = notebook_.events.at(1).transition.stamp_ns;
  EXPECT_NEAR(static_cast<double>(
                  notebook_.evidence.back().second.sample.stamp_ns - isolated),
              600e9, 1.1e9);
}

TEST_F(ValveMonitorTest, ASupersededEpisodeBelongsToItsOwnSource) {
  Feed(0, 100);
  Feed(100, 120, kF7Offset);
  Feed(0, 5, 0.0, 2);

  const FaultEvent& closed = notebook_.events.back();
  EXPECT_EQ(closed.transition.kind, TransitionKind::kClosed);
  EXPECT_EQ(closed.transition.reason, EndReason::kSuperseded);
  EXPECT_EQ(closed.source_id, 1U);
  EXPECT_EQ(closed.episode_id, EpisodeId("V1", 1, PlantSample(100).stamp_ns));
  for (const auto& [episode, point] : notebook_.evidence) {
    EXPECT_EQ(point.sample.source_id, 1U);
  }
}

TEST_F(ValveMonitorTest, TheEndOfTheStreamClosesTheEpisode) {
  Feed(0, 100);
  Feed(100, 120, kF7Offset);
  Feed(PlantSample(110, kF7Offset));  // Late.

  EXPECT_TRUE(valve_.EndStream(kWriter, notebook_));

  const Transition& last = notebook_.events.back().transition;
  EXPECT_EQ(last.reason, EndReason::kStreamEnded);
  EXPECT_EQ(last.stamp_ns, PlantSample(119).stamp_ns);
  EXPECT_FALSE(valve_.episode_open());
}

TEST_F(ValveMonitorTest, AnEarlierPublisherCannotEndTheStreamOfItsSuccessor) {
  Feed(0, 50);
  for (std::uint64_t k = 0; k < 5; ++k) {
    Feed(PlantSample(k, 0.0, 2), kWriter + 1);
  }
  Feed(PlantSample(50, 0.0, 1));  // Superseded.

  EXPECT_FALSE(valve_.EndStream(kWriter, notebook_));
  EXPECT_TRUE(valve_.EndStream(kWriter + 1, notebook_));
}

TEST_F(ValveMonitorTest, ThreeSilentPeriodsMakeAValveStaleUntilItSpeaks) {
  Feed(0, 10);

  EXPECT_FALSE(valve_.CheckStale(now_ + seconds(3), notebook_));
  EXPECT_TRUE(
      valve_.CheckStale(now_ + std::chrono::milliseconds(3001), notebook_));
  EXPECT_FALSE(valve_.CheckStale(now_ + seconds(5), notebook_));
  EXPECT_TRUE(valve_.stale());
  Feed(10, 11);
  EXPECT_FALSE(valve_.stale());
}

TEST_F(ValveMonitorTest, NothingConfirmsTheEpisodeOfASilentValve) {
  Feed(0, 100);
  EXPECT_TRUE(valve_.CheckStale(now_ + seconds(10), notebook_));
  Feed(100, 120, kF7Offset);
  EXPECT_THAT(notebook_.silences, testing::IsEmpty()) << "there was none";

  EXPECT_TRUE(valve_.CheckStale(now_ + seconds(10), notebook_));
  EXPECT_THAT(notebook_.silences, ElementsAre(PlantSample(119).stamp_ns));
  Feed(120, 122, kF7Offset);
  EXPECT_THAT(notebook_.silences,
              ElementsAre(PlantSample(119).stamp_ns, std::nullopt));
}

TEST_F(ValveMonitorTest, ALongSilenceClosesTheEpisode) {
  Feed(0, 100);
  Feed(100, 120, kF7Offset);
  ASSERT_TRUE(valve_.CheckStale(now_ + seconds(10), notebook_));

  valve_.CheckTimeout(now_ + seconds(59), seconds(60), notebook_);
  EXPECT_TRUE(valve_.episode_open());
  valve_.CheckTimeout(now_ + seconds(61), seconds(60), notebook_);

  EXPECT_EQ(notebook_.events.back().transition.reason,
            EndReason::kStaleTimeout);
}

TEST_F(ValveMonitorTest, AnotherModelSetClosesTheEpisodeAndSettles) {
  Feed(0, 100);
  Feed(100, 120, kF7Offset);

  ASSERT_TRUE(valve_.Adopt(EngineParts(SharedLinearModels(0x99)), notebook_));
  const ValveOutcome first = Feed(PlantSample(120, kF7Offset));

  EXPECT_EQ(notebook_.events.back().transition.reason,
            EndReason::kModelChanged);
  EXPECT_EQ(notebook_.events.back().model_hash, 0x1234U);
  EXPECT_TRUE(first.model_swapped);
  EXPECT_EQ(first.models->content_hash, 0x99U);
  EXPECT_EQ(first.verdict.quality, Quality::kSettling);
  EXPECT_FALSE(Feed(PlantSample(121)).model_swapped);
  EXPECT_EQ(Feed(PlantSample(121)).verdict.intake, Intake::kRepeat);
}

TEST_F(ValveMonitorTest, TheSameModelSetAgainChangesNothing) {
  Feed(0, 100);
  Feed(100, 120, kF7Offset);

  EXPECT_FALSE(valve_.Adopt(EngineParts(SharedLinearModels()), notebook_));
  EXPECT_TRUE(valve_.episode_open());
}

TEST_F(ValveMonitorTest, WithoutAModelSetAValveIsListedAndNotDiagnosed) {
  ValveMonitor bare("V2", std::nullopt, {});
  const ValveOutcome outcome =
      bare.Step(PlantSample(5, kF7Offset), 1, now_, notebook_);

  EXPECT_EQ(outcome.models, nullptr);
  EXPECT_EQ(outcome.verdict.quality, Quality::kUnassigned);
  EXPECT_EQ(outcome.verdict.seq, 5U);
  ASSERT_TRUE(bare.Adopt(EngineParts(SharedLinearModels()), notebook_));
  EXPECT_NE(bare.Step(PlantSample(6), 1, now_, notebook_).models, nullptr);
}

// Neither the time since 1970 nor a gap is the period of its samples.
TEST_F(ValveMonitorTest, WithoutAModelSetASampleStandsForOnePeriod) {
  const auto seen_s = [this](std::uint64_t from) {
    double sum = 0.0;
    for (std::uint64_t k = from; k < from + 10; ++k) {
      sum += Feed(PlantSample(k)).period_s;
    }
    return sum;
  };
  ASSERT_EQ(seen_s(0), 10.0);

  ASSERT_TRUE(valve_.Adopt(std::nullopt, notebook_));
  EXPECT_EQ(seen_s(10), 10.0);
  EXPECT_EQ(seen_s(1000), 10.0);
}

TEST_F(ValveMonitorTest, AnOpenEpisodeGoesOnUnderItsIdAfterARestart) {
  valve_.Recover(LeftOpen());
  Feed(150, 200, kF7Offset);  // f7 acts from the first sample on.
  Feed(200, 250);

  // Observers without lags see the fault at once after settling.
  EXPECT_THAT(notebook_.resumed, ElementsAre(LeftOpen().episode_id));
  EXPECT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kCleared, TransitionKind::kClosed));
  EXPECT_EQ(notebook_.events.at(0).episode_id, LeftOpen().episode_id);
  EXPECT_EQ(notebook_.events.at(0).transition.detection_stamp_ns,
            LeftOpen().detection_stamp_ns);
  ASSERT_EQ(notebook_.gaps.size(), 1U);
  EXPECT_EQ(notebook_.gaps[0].reason, "monitor_down");
  EXPECT_EQ(notebook_.gaps[0].from_ns, PlantSample(120).stamp_ns);
  EXPECT_EQ(notebook_.gaps[0].to_ns, PlantSample(150).stamp_ns);
}

TEST_F(ValveMonitorTest, AResumedEpisodeWithAnotherFaultIsReisolated) {
  valve_.Recover(LeftOpen());
  Feed(150, 200, kF1Offset);

  EXPECT_THAT(notebook_.Kinds(), ElementsAre(TransitionKind::kReisolated));
  EXPECT_EQ(notebook_.events.at(0).candidates.front().fault, 1);
}

// Every output of the valve says the same.
TEST_F(ValveMonitorTest, AFaultThatGrowsIsAnnouncedOnceItsPriorityRises) {
  ValveMonitor valve(
      "V1", EngineParts(SharedLinearModels()), {}, nullptr,
      std::make_shared<const SeverityCatalogue>(SeverityCatalogue{
          {7, {{0.0, Severity::kMedium}, {0.9, Severity::kCritical}}}}));
  for (std::uint64_t k = 0; k < 2400; ++k) {
    const double strength = k < 100 ? 0.0 : 0.8 + 8e-5 * static_cast<double>(k);
    const ValveOutcome outcome = valve.Step(
        PlantSample(k, kF7Offset * strength), kWriter, now_, notebook_);
    if (!notebook_.strengths.empty()) {
      ASSERT_EQ(outcome.verdict.strengths[1],
                notebook_.strengths.back().strength);
    }
  }
  ASSERT_THAT(notebook_.Kinds(),
              ElementsAre(TransitionKind::kDetected, TransitionKind::kIsolated,
                          TransitionKind::kChanged));
  const FaultEvent& changed = notebook_.events[2];
  EXPECT_EQ(changed.transition.severity, Severity::kCritical);
  EXPECT_GE(changed.transition.lowest, 0.9);
  EXPECT_NEAR(changed.transition.strength, 0.91, 0.03);
  EXPECT_EQ(changed.transition.faults, 0b10U);
  EXPECT_EQ(changed.candidates.at(0).strength, changed.transition.strength);
  EXPECT_EQ(notebook_.strengths.front().severity, Severity::kMedium);
  EXPECT_EQ(notebook_.strengths.back().severity, Severity::kCritical);
}

// As many samples as end an episode, once.
TEST_F(ValveMonitorTest, AValveIsConfirmedNormalAfterEachEndOfItsData) {
  const int needed = SharedLinearModels()->decision.clearing_samples;
  Feed(0, 40 + static_cast<std::uint64_t>(needed));
  ASSERT_EQ(notebook_.normal.size(), 1U);
  EXPECT_TRUE(valve_.EndStream(kWriter, notebook_));
  Feed(1000, 1200);
  EXPECT_EQ(notebook_.normal.size(), 2U);
}

TEST_F(ValveMonitorTest, ANormalMinuteAfterARestartClosesTheEpisodeUnknown) {
  valve_.Recover(LeftOpen());
  Feed(150, 210);
  EXPECT_TRUE(notebook_.events.empty());
  Feed(210, 212);

  ASSERT_EQ(notebook_.events.size(), 1U);
  EXPECT_EQ(notebook_.events.at(0).transition.reason, EndReason::kUnknown);
  EXPECT_EQ(notebook_.events.at(0).episode_id, LeftOpen().episode_id);
  Feed(212, 230, kF7Offset);
  EXPECT_EQ(notebook_.events.at(1).transition.kind, TransitionKind::kDetected);
  EXPECT_NE(notebook_.events.at(1).episode_id, LeftOpen().episode_id);
}

TEST_F(ValveMonitorTest, AnotherSourceDoesNotResumeTheEpisode) {
  valve_.Recover(LeftOpen());
  Feed(0, 30, kF7Offset, 5);

  EXPECT_TRUE(notebook_.resumed.empty());
  EXPECT_EQ(notebook_.events.at(0).transition.reason, EndReason::kUnknown);
}

TEST_F(ValveMonitorTest, AnotherModelSetDoesNotResumeTheEpisode) {
  OpenEpisode episode = LeftOpen();
  episode.model_hash = 0x77;
  valve_.Recover(episode);
  Feed(150, 180, kF7Offset);

  EXPECT_TRUE(notebook_.resumed.empty());
  EXPECT_EQ(notebook_.events.at(0).transition.reason, EndReason::kModelChanged);
}

TEST_F(ValveMonitorTest, ASilentValveGivesItsOpenEpisodeUp) {
  valve_.Recover(LeftOpen());
  const std::int64_t now_ns = PlantSample(500).stamp_ns;

  valve_.ExpireRecovery(now_ns, notebook_);
  valve_.ExpireRecovery(now_ns, notebook_);

  ASSERT_EQ(notebook_.events.size(), 1U);
  EXPECT_EQ(notebook_.events.at(0).transition.reason, EndReason::kUnknown);
  ASSERT_EQ(notebook_.gaps.size(), 1U);
  EXPECT_EQ(notebook_.gaps[0].to_ns, now_ns);
}

// As by values that come when they change: two of each twelve are missing, and
// the observers never settle.
TEST_F(ValveMonitorTest, AValveThatIsNotJudgedForLongSaysSinceWhen) {
  Feed(0, 100);
  ASSERT_EQ(valve_.verdict().quality, Quality::kLive);
  for (std::uint64_t k = 102; k < 690; k += 12) {
    Feed(k, k + 10);
    EXPECT_FALSE(valve_.unjudged_since_ns()) << k;
  }
  for (std::uint64_t k = 690; k < 740; k += 12) {
    Feed(k, k + 10);
  }
  ASSERT_EQ(valve_.verdict().quality, Quality::kSettling);
  EXPECT_EQ(valve_.unjudged_since_ns(), PlantSample(99).stamp_ns);
  EXPECT_EQ(Feed(PlantSample(740)).unjudged_ns, PlantSample(99).stamp_ns);
  Feed(741, 800);
  EXPECT_FALSE(valve_.unjudged_since_ns());
  // Samples that were not there could not be judged.
  Feed(90'000, 90'010);
  EXPECT_FALSE(valve_.unjudged_since_ns());
}

// A value that its source repeats as UNCERTAIN is no new reading.
TEST_F(ValveMonitorTest, AValveWhoseReadingsAreHeldIsNotJudged) {
  Feed(0, 100);
  for (std::uint64_t k = 100; k < 800; ++k) {
    Sample held = PlantSample(k);
    held.quality.fill(SignalQuality::kUncertain);
    Feed(held);
  }
  ASSERT_TRUE(valve_.unjudged_since_ns());
  EXPECT_GE(*valve_.unjudged_since_ns(), PlantSample(99).stamp_ns);
  EXPECT_LE(*valve_.unjudged_since_ns(), PlantSample(161).stamp_ns);
  const Verdict& verdict = valve_.verdict();
  EXPECT_EQ(WhyUnjudged(verdict.quality, verdict.intake, verdict.uncovered),
            "BAD_INPUT no_readings");
  Feed(800, 900);
  EXPECT_FALSE(valve_.unjudged_since_ns());
}

TEST_F(ValveMonitorTest, MissingAndUnusableSamplesAreGaps) {
  Feed(0, 50);
  Feed(60, 80);
  for (std::uint64_t k = 80; k < 90; ++k) {
    Feed(BadSample(k));
  }
  Feed(90, 95);
  Feed(97, 99);  // Two samples missing are none.

  ASSERT_EQ(notebook_.gaps.size(), 2U);
  EXPECT_EQ(notebook_.gaps[0].reason, "stream");
  EXPECT_EQ(notebook_.gaps[0].from_ns, PlantSample(49).stamp_ns);
  EXPECT_EQ(notebook_.gaps[0].to_ns, PlantSample(60).stamp_ns);
  EXPECT_EQ(notebook_.gaps[1].reason, "bad_input");
}

}  // namespace
}  // namespace fdi::monitor
