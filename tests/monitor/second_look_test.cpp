#include <chrono>
#include <cmath>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "diagnosis/decision/episode_names.h"
#include "monitor/counters.h"
#include "monitor/episode_tracker.h"
#include "monitor/names/look_worker.h"
#include "monitor/names/pending_looks.h"
#include "monitor/pipeline.h"
#include "monitor/throttled_log.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"
#include "tests/monitor/test_support.h"
#include "tests/simulator/recorded_valve.h"

namespace fdi::monitor {
namespace {

using simulator::Abrupt;
using simulator::kLeadIn;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::uint64_t kAtOnce = kLeadIn + 2;  // Row of the detection.
constexpr std::uint64_t kFirstLook = kAtOnce + 40;
constexpr std::uint64_t kCounts = kFirstLook + 10;

std::shared_ptr<const ModelSet> Models() {
  ModelSet models = LinearModels();
  models.faults = {1, 7, 13, 19};
  models.physics = simulator::ToValues(simulator::Physics());
  // Trained with P1, P2, T1 and F.
  models.validity.dp = {-1e6, 1e6};
  models.validity.t1 = {-1e6, 1e6};
  models.floor.emplace().flow_gain = 1.0;
  return std::make_shared<const ModelSet>(std::move(models));
}

constexpr FaultSet kF7 = 0b0010;
constexpr FaultSet kF19 = 0b1000;

class EventList : public FakeOutlet {
 public:
  void OnEvent(FaultEvent event) override {
    events.push_back(std::move(event));
  }
  void OnLook(EpisodeLook look) override { looks.push_back(std::move(look)); }
  void OnStrength(StrengthPoint point) override { strengths.push_back(point); }
  std::vector<FaultEvent> events;
  std::vector<EpisodeLook> looks;
  std::vector<StrengthPoint> strengths;
};

// The engine takes f19 for f7.
class SecondLookTest : public testing::Test {
 protected:
  ~SecondLookTest() override { worker_.Stop(); }

  bool AwaitLooks(std::uint64_t count) {
    const auto until = std::chrono::steady_clock::now() + seconds(300);
    while (counters_[Counter::kLooks] < count &&
           std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return counters_[Counter::kLooks] == count;
  }

  static Sample SampleOf(const RecordRow& row, std::uint64_t k) {
    Sample sample = PlantSample(k);
    simulator::SetReadings(row, sample);
    return sample;
  }

  void Transit(TransitionKind kind) {
    Transition& t =
        engine_
            .transitions[static_cast<std::size_t>(engine_.transition_count++)];
    t = {};
    t.kind = kind;
    t.stamp_ns = engine_.stamp_ns;
    t.detection_stamp_ns = PlantSample(kAtOnce).stamp_ns;
    t.faults = engine_.isolated;
  }

  // Engine at row k: detected at kAtOnce, f7 five rows later.
  void Observe(std::uint64_t k) {
    engine_.stamp_ns = PlantSample(k).stamp_ns;
    engine_.source_id = 1;
    engine_.quality = Quality::kLive;
    engine_.transition_count = 0;
    if (k == kAtOnce) {
      engine_.detected = true;
      engine_.state = State::kDetected;
      Transit(TransitionKind::kDetected);
    } else if (k == kAtOnce + 5) {
      engine_.state = State::kIsolated;
      engine_.isolated = kF7;
      engine_.fault_factors[1] = 0.9;
      engine_.fault_factors[2] = 0.6;
      engine_.strengths[1] = 1.0;
      Transit(TransitionKind::kIsolated);
    }
  }

  void Clear(std::uint64_t k) {
    Observe(k);
    Transit(TransitionKind::kCleared);
    Transit(TransitionKind::kClosed);
    engine_.detected = false;
    engine_.state = State::kNormal;
    engine_.isolated = 0;
  }

  const Verdict& Step(std::uint64_t k) {
    const Sample sample = SampleOf(rows_.at(k), k);
    tracker_.Advance(sample, engine_, *models_, outlet_);
    for (auto& [task, answer] : pending_.Collect()) {
      names_.Answer(task, std::move(answer));
    }
    const Verdict& verdict = names_.Step(sample, engine_, held_);
    pending_.Request(names_.TakeDue(), physics_);
    tracker_.Step(sample, verdict, models_, outlet_);
    tracker_.Take(names_.TakeLook(), outlet_);
    tracker_.Take(names_.TakeStrengths(), outlet_);
    return verdict;
  }

  void RequestGrowth() {
    names_.RequestGrowth();
    pending_.Request(names_.TakeDue(), physics_);
  }

  // Rows [from, to).
  void Feed(std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t k = from; k < to; ++k) {
      Observe(k);
      Step(k);
    }
  }

  std::vector<TransitionKind> Kinds() const {
    std::vector<TransitionKind> kinds;
    for (const FaultEvent& event : outlet_.events) {
      kinds.push_back(event.transition.kind);
    }
    return kinds;
  }

  Counters counters_;
  std::vector<std::string> lines_;
  ThrottledLog log_{
      [this](LogLevel, std::string_view line) { lines_.emplace_back(line); }};
  LookWorker worker_{
      LookReportOf({counters_, log_, [] { return std::int64_t{0}; }}), 3};
  std::shared_ptr<const ModelSet> models_{Models()};
  LookWorker::Physics physics_{worker_.PhysicsOf(*models_)};
  EpisodeNames names_{models_, physics_};
  PendingLooks pending_{"V1", &worker_};
  EpisodeTracker tracker_{"V1", {}};
  EventList outlet_;
  std::vector<RecordRow> rows_{
      simulator::Recording(kLeadIn + 400, 2, {Abrupt(19, 0.25)})};
  Verdict engine_;
  bool held_{false};
};

TEST_F(SecondLookTest, TheSimulationCorrectsTheNameTenSecondsAfterItsSamples) {
  Feed(0, kFirstLook + 1);
  worker_.Start();  // The early look, replaced, is not taken.
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts);
  ASSERT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                   TransitionKind::kIsolated));

  Observe(kCounts);
  const Verdict& verdict = Step(kCounts);
  EXPECT_EQ(verdict.isolated, kF19);
  EXPECT_NEAR(verdict.strengths[3], 0.25, 0.05);
  ASSERT_EQ(outlet_.events.size(), 3U);
  const FaultEvent& event = outlet_.events.back();
  EXPECT_EQ(event.transition.kind, TransitionKind::kReisolated);
  EXPECT_EQ(event.transition.faults, kF19);
  EXPECT_EQ(event.transition.stamp_ns, PlantSample(kCounts).stamp_ns);
  EXPECT_EQ(event.transition.layer, Layer::kPhysics);
  EXPECT_NEAR(event.transition.strength, 0.25, 0.05);
  ASSERT_EQ(event.candidates.size(), 1U);
  EXPECT_EQ(event.candidates[0].fault, 19);
  EXPECT_NEAR(event.candidates[0].strength, 0.25, 0.05);
  EXPECT_TRUE(event.candidates[0].isolated);

  Feed(kCounts + 1, kCounts + 5);
  ASSERT_EQ(outlet_.looks.size(), 1U);
  const EpisodeLook& look = outlet_.looks.front();
  EXPECT_EQ(look.episode_id, event.episode_id);
  EXPECT_EQ(look.first_ns, PlantSample(kAtOnce - 120).stamp_ns);
  EXPECT_EQ(look.RowAt(PlantSample(kFirstLook).stamp_ns),
            look.x_pct.size() - 1);
  ASSERT_FALSE(look.faults.empty());
  EXPECT_EQ(look.faults[0].fault, 19);
  EXPECT_LT(look.faults[0].lowest, 0.25);
  EXPECT_GT(look.faults[0].highest, 0.25);
  EXPECT_NEAR(static_cast<double>(look.faults[0].begins_ns -
                                  PlantSample(kLeadIn).stamp_ns),
              0.0, 4e9);
  ASSERT_EQ(look.flow.size(), look.x_pct.size());
  double error = 0.0;
  for (std::size_t row = 0; row < look.flow.size(); ++row) {
    error += std::abs(look.flow[row] - rows_[kAtOnce - 120 + row].flow);
  }
  EXPECT_LT(error / static_cast<double>(look.flow.size()), 0.5);
}

TEST_F(SecondLookTest, ALookForGrowthTellsTheStrengthAndChangesNoName) {
  RequestGrowth();  // Nothing is named yet.
  Feed(0, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts + 20);
  ASSERT_EQ(outlet_.strengths.size(), 1U);  // The naming look's.
  const StrengthPoint named = outlet_.strengths[0];
  EXPECT_EQ(named.stamp_ns, (outlet_.looks[0].faults[0].begins_ns +
                             PlantSample(kFirstLook).stamp_ns) /
                                2);
  EXPECT_EQ(named.strength, outlet_.looks[0].faults[0].strength);

  RequestGrowth();
  ASSERT_TRUE(AwaitLooks(2));
  Feed(kCounts + 20, kCounts + 21);
  ASSERT_EQ(outlet_.strengths.size(), 2U);
  const StrengthPoint& p = outlet_.strengths[1];
  EXPECT_EQ(p.episode_id, outlet_.events[0].episode_id);
  EXPECT_EQ(p.fault, 19);
  EXPECT_EQ(p.layer, Layer::kPhysics);
  // From two minutes before the detection to the last row.
  EXPECT_EQ(p.stamp_ns, (PlantSample(kAtOnce - 120).stamp_ns +
                         PlantSample(kCounts + 19).stamp_ns) /
                            2);
  EXPECT_LT(p.lowest, p.strength);
  EXPECT_GT(p.highest, p.strength);
  EXPECT_EQ(outlet_.events.size(), 3U);
  EXPECT_EQ(outlet_.looks.size(), 1U);

  RequestGrowth();
  ASSERT_TRUE(AwaitLooks(3));
  Clear(kCounts + 21);
  Step(kCounts + 21);  // It is over: what the look found is of no use.
  EXPECT_EQ(outlet_.strengths.size(), 2U);
}

// The worker takes it last, however early it was asked for.
TEST_F(SecondLookTest, ALookForGrowthWaitsForTheOthersAndReplacesNone) {
  const LookWindow window = simulator::Window({Abrupt(19, 0.25)});
  const auto ask = [&](LookOccasion occasion) {
    LookTask task;
    task.window = window;
    task.stamp_ns = kSecond * 1000;
    task.occasion = occasion;
    Explanation f19;
    f19.fault = 19;
    f19.strength = 0.2;
    task.known = {f19};
    return worker_.Submit("V1", physics_, std::move(task));
  };
  auto growth = ask(LookOccasion::kGrowth);
  auto again = ask(LookOccasion::kGrowth);
  auto naming = ask(LookOccasion::kEpisode);
  auto routine = ask(LookOccasion::kStill);
  worker_.Start();
  const auto answer = growth.get();
  using std::future_status;
  EXPECT_EQ(naming.wait_for(seconds(0)), future_status::ready);
  EXPECT_EQ(routine.wait_for(seconds(0)), future_status::ready);
  EXPECT_TRUE(naming.get() && routine.get());
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->faults.at(0).fault, 19);
  const auto same = again.get();
  ASSERT_TRUE(same);
  EXPECT_EQ(same->faults.at(0).strength, answer->faults.at(0).strength);
}

TEST_F(SecondLookTest, ThatNameStaysWhateverTheEngineIsolates) {
  Feed(0, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts + 20);
  engine_.isolated = 0b0100;
  Observe(kCounts + 20);
  Transit(TransitionKind::kReisolated);
  EXPECT_EQ(Step(kCounts + 20).isolated, kF19);
  EXPECT_EQ(outlet_.events.size(), 3U);

  Clear(kCounts + 21);
  EXPECT_EQ(Step(kCounts + 21).state, State::kNormal);
  ASSERT_EQ(outlet_.events.size(), 5U);
  for (const FaultEvent& event : {outlet_.events[3], outlet_.events[4]}) {
    EXPECT_EQ(event.transition.faults, kF19);
    EXPECT_NEAR(event.transition.strength, 0.25, 0.05);
    EXPECT_EQ(event.candidates.front().fault, 19);
  }
}

TEST_F(SecondLookTest, SamplesDoNotWaitForAnAnswerWhichCountsOnceItIsThere) {
  Feed(0, kCounts + 60);  // Nobody looks yet.
  EXPECT_EQ(outlet_.events.size(), 2U);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kCounts + 60, kCounts + 61);
  ASSERT_EQ(outlet_.events.size(), 3U);
  EXPECT_EQ(outlet_.events.back().transition.stamp_ns,
            PlantSample(kCounts + 60).stamp_ns);
}

TEST_F(SecondLookTest, AnEpisodeThatTheEngineEndsKeepsTheName) {
  Feed(0, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts + 1);
  Transition closed;
  closed.kind = TransitionKind::kClosed;
  closed.faults = kF7;
  closed.unknown = Unknown::kTooEarly;
  const Transition named = names_.End(closed);
  EXPECT_EQ(named.faults, kF19);
  EXPECT_EQ(named.unknown, Unknown::kNone);
  EXPECT_EQ(names_.End(closed).faults, kF7);  // The next episode.
}

TEST_F(SecondLookTest, WhatNoFaultExplainsBecomesUnknown) {
  for (std::size_t k = 40; k < rows_.size(); ++k) {
    rows_[k].x_pct = k % 2 == 0 ? 10.0 : 90.0;
    rows_[k].flow *= k % 3 == 0 ? 0.1 : 1.5;
  }
  Feed(0, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts);
  Observe(kCounts);
  const Verdict& verdict = Step(kCounts);
  EXPECT_EQ(verdict.isolated, 0U);
  EXPECT_EQ(verdict.state, State::kDetected);
  EXPECT_EQ(verdict.unknown, Unknown::kOutsideKnown);
  ASSERT_EQ(outlet_.events.size(), 3U);
  const FaultEvent& event = outlet_.events.back();
  EXPECT_EQ(event.transition.kind, TransitionKind::kReisolated);
  EXPECT_EQ(event.transition.faults, 0U);
  EXPECT_EQ(event.transition.unknown, Unknown::kOutsideKnown);
  EXPECT_THAT(event.candidates, IsEmpty());
}

TEST_F(SecondLookTest, TheObserversNameStandsIfTheValveLooksHealthy) {
  rows_ = simulator::Recording(kLeadIn + 100, 2, {});
  Feed(0, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Feed(kFirstLook + 1, kCounts + 20);
  EXPECT_EQ(outlet_.events.size(), 2U);
}

TEST_F(SecondLookTest, AResumedEpisodeKeepsItsNameUntilALookAnswers) {
  OpenEpisode open;
  open.valve_id = "V1";
  open.source_id = 1;
  open.episode_id = 5;
  open.detection_stamp_ns = PlantSample(0).stamp_ns - 9 * kSecond;
  open.last_stamp_ns = PlantSample(0).stamp_ns - kSecond;
  open.isolated = true;
  open.faults = 0b0100;
  open.layer = Layer::kPhysics;
  open.model_hash = models_->content_hash;
  Feed(0, kAtOnce - 40);
  tracker_ = EpisodeTracker("V1", {});
  tracker_.Recover(open);
  names_.Inherit(&open);
  Feed(kAtOnce - 40, kFirstLook + 1);
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  Observe(kFirstLook + 1);
  EXPECT_EQ(Step(kFirstLook + 1).isolated, 0b0100U);
  EXPECT_THAT(outlet_.events, IsEmpty());
  Feed(kFirstLook + 2, kCounts + 1);
  ASSERT_EQ(outlet_.events.size(), 1U);
  EXPECT_EQ(outlet_.events[0].episode_id, 5U);
  EXPECT_EQ(outlet_.events[0].transition.kind, TransitionKind::kReisolated);
  EXPECT_EQ(outlet_.events[0].transition.faults, kF19);
}

TEST_F(SecondLookTest, NothingIsNamedWhileIsolationIsHeld) {
  held_ = true;
  Feed(0, kFirstLook + 5);
  EXPECT_EQ(worker_.waiting(), 0U);
}

// Follows a valve of which the observers see nothing.
TEST_F(SecondLookTest, ARoutineLookAsksForAnEpisodeAndNamesIt) {
  rows_ = simulator::Recording(1100, 2, {Abrupt(13, -0.2)});
  worker_.Start();
  const auto observe = [this](std::uint64_t k) {
    engine_.stamp_ns = PlantSample(k).stamp_ns;
    engine_.source_id = 1;
    engine_.quality = Quality::kLive;
    engine_.transition_count = 0;
    if (names_.suspects() && !engine_.detected) {
      engine_.detected = true;
      engine_.state = State::kDetected;
      Transit(TransitionKind::kDetected);
      engine_.transitions[0].detection_stamp_ns = engine_.stamp_ns;
    }
    Step(k);
  };
  constexpr std::uint64_t kFirst = 700;  // At a multiple of 300 s.
  constexpr std::uint64_t kAgain = kFirst + 300;
  for (std::uint64_t k = 0; k <= kAgain + 60; ++k) {
    observe(k);
    if (k == kFirst || k == kAgain) {  // The answer is there before it counts.
      ASSERT_TRUE(AwaitLooks(k == kFirst ? 1 : 2));
    }
  }
  EXPECT_TRUE(names_.suspects());
  EXPECT_THAT(outlet_.events, IsEmpty());
  for (std::uint64_t k = kAgain + 61; k < rows_.size(); ++k) {
    observe(k);
  }
  ASSERT_THAT(Kinds(), ElementsAre(TransitionKind::kDetected,
                                   TransitionKind::kIsolated));
  EXPECT_EQ(outlet_.events[1].transition.faults, 0b0100U);
  EXPECT_EQ(outlet_.events[1].transition.layer, Layer::kPhysics);
  EXPECT_NEAR(outlet_.events[1].transition.strength, -0.2, 0.05);
  ASSERT_EQ(outlet_.looks.size(), 1U);
  EXPECT_EQ(outlet_.looks[0].faults.at(0).begins_ns, outlet_.looks[0].first_ns);
}

class LookWorkerTest : public SecondLookTest {
 protected:
  std::future<LookWorker::Answer> Submit(const std::string& valve) {
    LookTask task;
    task.window = simulator::Window({Abrupt(19, 0.25)});
    return worker_.Submit(valve, physics_, std::move(task));
  }
  static bool Ready(const std::future<LookWorker::Answer>& answer) {
    return answer.wait_for(seconds(0)) == std::future_status::ready;
  }
};

TEST_F(LookWorkerTest, CountsWhatDoesNotFitAndAnswersIt) {
  std::vector<std::future<LookWorker::Answer>> answers;
  for (const char* valve : {"V1", "V2", "V3", "V4"}) {
    answers.push_back(Submit(valve));
  }
  EXPECT_FALSE(Ready(answers[2]));
  ASSERT_TRUE(Ready(answers[3]));
  EXPECT_FALSE(answers[3].get());
  EXPECT_EQ(counters_[Counter::kLooksDropped], 1U);
  ASSERT_EQ(lines_.size(), 1U);
  EXPECT_THAT(lines_[0], HasSubstr("second_look_dropped id=M161 valve=V4"));
}

TEST_F(LookWorkerTest, ANewerLookReplacesTheOneOfTheValveThatWaits) {
  auto older = Submit("V1");
  auto newer = Submit("V1");
  ASSERT_TRUE(Ready(older));
  EXPECT_FALSE(older.get());
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  EXPECT_TRUE(newer.get());
  EXPECT_EQ(counters_[Counter::kLooksDropped], 0U);
}

TEST_F(LookWorkerTest, AStopWaitsForNoLook) {
  const auto first = Submit("V1");
  const auto second = Submit("V2");
  worker_.Start();
  while (worker_.waiting() > 1) {  // Until the first is in work.
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  worker_.Stop();
  EXPECT_EQ(counters_[Counter::kLooks], 0U);
  EXPECT_FALSE(Ready(second));
}

TEST_F(LookWorkerTest, ALookThatFailsIsReportedAndTheNextOneTaken) {
  auto failed = worker_.Submit("V1", physics_, {});
  auto next = Submit("V2");
  worker_.Start();
  ASSERT_TRUE(AwaitLooks(1));
  EXPECT_FALSE(failed.get());
  EXPECT_TRUE(next.get());
  EXPECT_EQ(counters_[Counter::kLooksFailed], 1U);
  ASSERT_EQ(lines_.size(), 1U);
  EXPECT_THAT(lines_[0], HasSubstr("second_look_failed id=M162 valve=V1"));
}

TEST_F(LookWorkerTest, PhysicsThatCannotBeUsedAreReported) {
  ModelSet models = *models_;
  models.physics.erase(models.physics.begin());
  EXPECT_EQ(worker_.PhysicsOf(models), nullptr);
  EXPECT_EQ(counters_[Counter::kLooksFailed], 1U);
  ASSERT_EQ(lines_.size(), 1U);
  EXPECT_THAT(lines_[0], HasSubstr("model_set=linear@1"));
  models.physics.clear();
  EXPECT_EQ(worker_.PhysicsOf(models), nullptr);
  EXPECT_EQ(counters_[Counter::kLooksFailed], 1U);
}

}  // namespace
}  // namespace fdi::monitor
