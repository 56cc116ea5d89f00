#include "diagnosis/decision/valve_engine.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/diagnosis/allocation_count.h"
#include "tests/diagnosis/engine_run.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::AddF3;
using tests::AddF6;
using tests::FullF6;
using tests::Noise;
using tests::PlantSample;
using tests::Seen;
using tests::SharedPlant;
using tests::StampOf;
using tests::StepRange;

TEST(ValveEngineTest, NormalOperationOpensNoEpisode) {
  ValveEngine engine(SharedPlant());
  Noise noise(1);
  const Seen seen =
      StepRange(engine, 0, 2000, [&](Sample& s) { noise.Add(s); });
  EXPECT_TRUE(seen.transitions.empty());
  EXPECT_EQ(seen.last.state, State::kNormal);
  EXPECT_EQ(seen.last.quality, Quality::kLive);
  EXPECT_EQ(seen.last.confidence, 1.0);
}

// Wrong by 6 deviations, in every third sample, and marked or not.
void DrawWrongly(Sample& sample, bool marked) {
  if (sample.seq % 3 == 0) {
    sample.values[Index(Signal::kF)] += 3.0;
    sample.quality[Index(Signal::kF)] =
        marked ? SignalQuality::kUncertain : SignalQuality::kGood;
  }
}

TEST(ValveEngineTest, WhatIsUncertainOpensNoEpisodeAndHidesNone) {
  for (const bool marked : {false, true}) {
    ModelSet models = tests::LinearPlant();
    models.decision.detection_samples = 1;
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    const Seen healthy =
        StepRange(engine, 0, 300, [&](Sample& s) { DrawWrongly(s, marked); });
    EXPECT_EQ(healthy.transitions.empty(), marked);
    if (marked) {
      EXPECT_EQ(healthy.last.quality, Quality::kLive);
      const Seen faulty = StepRange(engine, 300, 400, [&](Sample& s) {
        FullF6(s);
        DrawWrongly(s, marked);
      });
      ASSERT_EQ(faulty.transitions.size(), 2U);
      EXPECT_EQ(faulty.transitions[0].stamp_ns, StampOf(301));
      EXPECT_EQ(faulty.last.state, State::kIsolated);
    }
  }
}

void MarkAll(Sample& sample) {
  sample.quality.fill(SignalQuality::kUncertain);
}

TEST(ValveEngineTest, AllUncertainLeavesEverythingAsItIsForAMinute) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen isolated = StepRange(engine, 50, 100, FullF6);
  ASSERT_EQ(isolated.last.state, State::kIsolated);
  const Seen held = StepRange(engine, 100, 160, MarkAll);
  EXPECT_TRUE(held.transitions.empty());
  EXPECT_EQ(held.last.quality, Quality::kLive);
  EXPECT_EQ(held.last.fault_factors, isolated.last.fault_factors);
  const Seen unknown = StepRange(engine, 160, 200, MarkAll);
  EXPECT_TRUE(unknown.transitions.empty());
  EXPECT_EQ(unknown.last.quality, Quality::kBadInput);
  EXPECT_EQ(StepRange(engine, 200, 300).last.state, State::kNormal);
}

TEST(ValveEngineTest, DetectionBearsTheStampOfTheFirstAbnormalSample) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen seen = StepRange(engine, 50, 52, FullF6);
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kDetected);
  EXPECT_EQ(seen.transitions[0].stamp_ns, StampOf(50));
  EXPECT_EQ(seen.last.state, State::kDetected);
}

TEST(ValveEngineTest, OneAbnormalSampleIsNoDetection) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  EXPECT_TRUE(StepRange(engine, 50, 51, FullF6).transitions.empty());
  EXPECT_TRUE(StepRange(engine, 51, 80).transitions.empty());
}

TEST(ValveEngineTest, OneChannelAfterTheOtherIsNoDetection) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen x = StepRange(
      engine, 50, 51, [](Sample& s) { s.values[Index(Signal::kX)] -= 3.0; });
  const Seen f = StepRange(
      engine, 51, 52, [](Sample& s) { s.values[Index(Signal::kF)] += 3.0; });
  const Seen below = StepRange(
      engine, 52, 53, [](Sample& s) { s.values[Index(Signal::kF)] -= 3.0; });
  EXPECT_TRUE(x.transitions.empty());
  EXPECT_TRUE(f.transitions.empty());
  EXPECT_TRUE(below.transitions.empty());
}

TEST(ValveEngineTest, FaultIsIsolatedByTheSampleThatCompletesTk) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  // The window begins with the detection at sample 51.
  const Seen early = StepRange(engine, 50, 60, FullF6);
  EXPECT_EQ(early.last.state, State::kDetected);
  const Seen seen = StepRange(engine, 60, 61, FullF6);
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kIsolated);
  EXPECT_EQ(seen.transitions[0].stamp_ns, StampOf(60));
  EXPECT_NE(seen.transitions[0].faults & 4U, 0U);  // f6 is bit 2
}

TEST(ValveEngineTest, LookAlikesSeparateWhileTheValveMoves) {
  for (const int fault : {3, 6}) {
    ValveEngine engine(SharedPlant());
    Noise noise(static_cast<std::uint64_t>(fault));
    StepRange(engine, 0, 50, [&](Sample& s) { noise.Add(s); });
    const Seen seen = StepRange(engine, 50, 250, [&](Sample& s) {
      noise.Add(s);
      fault == 3 ? AddF3(s, 0.7) : AddF6(s, 0.7);
    });
    EXPECT_EQ(FaultSetName(engine.models(), seen.last.isolated),
              "f" + std::to_string(fault));
    const auto index =
        static_cast<std::size_t>(FaultIndex(engine.models(), fault));
    EXPECT_NEAR(seen.last.strengths[index], 0.7, 0.05);
  }
}

TEST(ValveEngineTest, LookAlikesStayTogetherAtAFixedPosition) {
  ValveEngine engine(SharedPlant());
  Noise noise(3);
  for (std::uint64_t k = 0; k < 250; ++k) {
    Sample sample = PlantSample(k, 0.0);
    noise.Add(sample);
    if (k >= 50) {
      AddF3(sample, 0.7);
    }
    engine.Step(sample);
  }
  Sample sample = PlantSample(250, 0.0);
  AddF3(sample, 0.7);
  EXPECT_EQ(FaultSetName(engine.models(), engine.Step(sample).isolated),
            "f3|f6");
}

TEST(ValveEngineTest, FaultThatMatchesNoObserverStaysUnknown) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen seen = StepRange(
      engine, 50, 300, [](Sample& s) { s.values[Index(Signal::kF)] -= 20.0; });
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.last.state, State::kDetected);
  EXPECT_EQ(FaultSetName(engine.models(), seen.last.isolated), "unknown");
}

// 20 below what any fault explains: after 2 t_k samples it is none of them.
TEST(ValveEngineTest, UnknownIsOutsideWhatIsKnownOnceNothingExplainsIt) {
  ValveEngine engine(SharedPlant());
  const int t_k = engine.models().decision.isolation_samples;
  StepRange(engine, 0, 50);
  const auto strange = [](Sample& s) { s.values[Index(Signal::kF)] -= 20.0; };
  // The detection is complete with sample 51.
  const Seen early = StepRange(engine, 50, 51 + 2 * t_k, strange);
  ASSERT_FALSE(early.transitions.empty());
  EXPECT_EQ(early.transitions[0].unknown, Unknown::kTooEarly);
  EXPECT_EQ(early.last.unknown, Unknown::kTooEarly);
  const Seen later = StepRange(engine, 51 + 2 * t_k, 52 + 2 * t_k, strange);
  EXPECT_EQ(later.last.unknown, Unknown::kOutsideKnown);
  const auto closed = engine.EndEpisode(EndReason::kStreamEnded);
  ASSERT_TRUE(closed.has_value());
  EXPECT_EQ(closed->unknown, Unknown::kOutsideKnown);
  EXPECT_EQ(engine.Step(PlantSample(80)).unknown, Unknown::kNone);
}

// f6 explains it every other sample: not long enough to name it.
TEST(ValveEngineTest, UnknownIsTooEarlyWhileKnownFaultsMayExplainIt) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  int toggle = 0;
  const Seen seen = StepRange(engine, 50, 200, [&](Sample& s) {
    AddF6(s, ++toggle % 2 == 0 ? 1.0 : 3.0);
  });
  EXPECT_EQ(seen.last.state, State::kDetected);
  EXPECT_EQ(seen.last.unknown, Unknown::kTooEarly);
}

TEST(ValveEngineTest, NamedEpisodeIsNotUnknown) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen seen = StepRange(engine, 50, 100, FullF6);
  ASSERT_EQ(seen.last.state, State::kIsolated);
  EXPECT_EQ(seen.last.unknown, Unknown::kNone);
  EXPECT_EQ(seen.transitions.back().unknown, Unknown::kNone);
}

TEST(ValveEngineTest, HeldIsolationNamesNothing) {
  ValveEngine engine(SharedPlant());
  engine.HoldIsolation(true);
  StepRange(engine, 0, 50);
  const Seen seen = StepRange(engine, 50, 200, FullF6);
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.last.state, State::kDetected);
  EXPECT_EQ(seen.last.isolated, 0U);
  engine.Adopt(SharedPlant());
  StepRange(engine, 200, 250);
  EXPECT_EQ(StepRange(engine, 250, 350, FullF6).last.state, State::kDetected);
  engine.HoldIsolation(false);
  EXPECT_EQ(StepRange(engine, 350, 351, FullF6).last.state, State::kIsolated);
}

TEST(ValveEngineTest, EpisodeClearsAfterTcNormalSamples) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  StepRange(engine, 50, 100, FullF6);
  EXPECT_TRUE(StepRange(engine, 100, 119).transitions.empty());
  const Seen seen = StepRange(engine, 119, 120);
  ASSERT_EQ(seen.transitions.size(), 2U);
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kCleared);
  EXPECT_EQ(seen.transitions[1].kind, TransitionKind::kClosed);
  EXPECT_EQ(seen.transitions[1].reason, EndReason::kCleared);
  EXPECT_FALSE(engine.episode_open());
}

TEST(ValveEngineTest, ASuspectValveHasAnEpisodeThatDoesNotClear) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  engine.Suspect(true);
  const Seen seen = StepRange(engine, 50, 200);
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kDetected);
  EXPECT_EQ(seen.transitions[0].stamp_ns, StampOf(50));
  EXPECT_TRUE(engine.episode_open());
  engine.Suspect(false);
  EXPECT_TRUE(StepRange(engine, 200, 219).transitions.empty());
  EXPECT_EQ(StepRange(engine, 219, 220).transitions.size(), 2U);
  EXPECT_FALSE(engine.episode_open());

  engine.Suspect(true);
  StepRange(engine, 220, 222);
  EXPECT_TRUE(engine.EndEpisode(EndReason::kStreamEnded));
  EXPECT_TRUE(StepRange(engine, 222, 300).transitions.empty());
}

TEST(ValveEngineTest, ValveThatStandsStillAfterwardsStaysInItsEpisode) {
  ModelSet models = tests::LinearPlant();
  models.decision.clearing_samples = 60;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  StepRange(engine, 0, 100);
  StepRange(engine, 100, 200, FullF6);
  for (std::uint64_t k = 200; k < 1000; ++k) {
    engine.Step(PlantSample(k, 0.0));
  }
  EXPECT_TRUE(engine.episode_open());
  StepRange(engine, 1000, 1100);
  EXPECT_FALSE(engine.episode_open());
}

TEST(ValveEngineTest, FaultBelowTheThresholdDoesNotClear) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  StepRange(engine, 50, 100, FullF6);
  const Seen seen = StepRange(engine, 100, 400, [](Sample& s) {
    s.values[Index(Signal::kF)] += 1.5;  // threshold 2
  });
  EXPECT_TRUE(engine.episode_open());
  EXPECT_NE(seen.last.state, State::kNormal);
}

TEST(ValveEngineTest, NoEpisodeBeginsOutsideAutomaticMode) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen seen = StepRange(engine, 50, 150, [](Sample& s) {
    AddF6(s, 1.0);
    s.mode = ValveMode::kCalibrating;
  });
  EXPECT_TRUE(seen.transitions.empty());
  EXPECT_EQ(seen.last.quality, Quality::kInhibited);
}

TEST(ValveEngineTest, NoEpisodeBeginsWhereTheCommandWasNotTrained) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen seen =
      StepRange(engine, 50, 100, [](Sample& s) { s.Set(Signal::kCv, 95.0); });
  EXPECT_TRUE(seen.transitions.empty());
  EXPECT_EQ(seen.last.quality, Quality::kUncovered);
}

TEST(ValveEngineTest, NewSourceClosesTheEpisodeAndSettles) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  StepRange(engine, 50, 70, FullF6);
  const Seen seen = StepRange(engine, 0, 1, [](Sample& s) { s.source_id = 8; });
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.transitions[0].reason, EndReason::kSuperseded);
  EXPECT_TRUE(seen.last.initialised);
  EXPECT_EQ(StepRange(engine, 70, 71).last.intake, Intake::kSuperseded);
}

TEST(ValveEngineTest, AdoptingAModelSetEndsTheEpisodeAndKeepsTheOrder) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  StepRange(engine, 50, 70, FullF6);
  const auto closed = engine.Adopt(SharedPlant());
  ASSERT_TRUE(closed.has_value());
  EXPECT_EQ(closed->kind, TransitionKind::kClosed);
  EXPECT_EQ(closed->reason, EndReason::kModelChanged);
  EXPECT_EQ(closed->detection_stamp_ns, StampOf(50));
  EXPECT_EQ(engine.Step(PlantSample(69)).intake, Intake::kRepeat);
  EXPECT_EQ(engine.Step(PlantSample(70)).quality, Quality::kSettling);
}

TEST(ValveEngineTest, StepDoesNotAllocate) {
  ValveEngine engine(SharedPlant());
  Noise noise(5);
  std::vector<Sample> samples;
  for (std::uint64_t k = 0; k < 400; ++k) {
    samples.push_back(PlantSample(k));
    noise.Add(samples.back());
    if (k > 100 && k < 250) {
      AddF3(samples.back(), 0.6);
    }
  }
  const long before = tests::AllocationCount();
  for (const Sample& sample : samples) {
    engine.Step(sample);
  }
  EXPECT_EQ(tests::AllocationCount() - before, 0);
}

TEST(ValveEngineTest, UnusableModelSetIsRefused) {
  ModelSet models = tests::LinearPlant();
  models.channels[0].upper_threshold = -1.0;
  EXPECT_THROW(ValveEngine(std::make_shared<const ModelSet>(models)),
               DataError);
}

// An observer that predicts nearly what the normal one does, and errs more in
// its own data, allows nearly everything: it may be the name, but not sure.
TEST(ValveEngineTest, AFaultThatOnlyToleratesWhatIsSeenIsNeverSure) {
  for (const bool explains : {true, false}) {
    ModelSet models = tests::LinearPlant();
    for (Observer& observer : models.observers) {
      ChannelObserver& flow = observer.channels[1];
      if (observer.fault == 6 && !explains) {
        flow = tests::LinearModel(Signal::kF, -1.0, 104.0);
        flow.residual_sd = 8.0;
        flow.membership = {-100.0, -50.0, 50.0, 100.0};
      }
      flow.fit = observer.fault == 0 ? FitBounds{} : FitBounds{-3.0, 3.0, 9.0};
    }
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    StepRange(engine, 0, 50);
    const Seen seen = StepRange(engine, 50, 150, FullF6);
    EXPECT_EQ(FaultSetName(engine.models(), seen.last.isolated), "f6");
    const double sure = explains ? 1.0 : 0.85;
    EXPECT_DOUBLE_EQ(seen.last.fault_factors[2], sure);
    for (const Transition& transition : seen.transitions) {
      if (transition.kind == TransitionKind::kIsolated) {
        EXPECT_DOUBLE_EQ(transition.factor, sure);
      }
    }
  }
}

// f3 and f6 are told apart by the command: at 50 % they are the same. Such
// faults are a set, and a set is narrowed once one of it is refuted.
TEST(ValveEngineTest, WhatIsNotRefutedIsNamedOnceAllOthersAre) {
  for (const double swing : {20.0, 0.0}) {
    for (const double error : {1e-3, 0.0}) {
      ModelSet models = tests::LinearPlant();
      models.decision.isolation_samples = 30;
      models.decision.early_error = error;
      ValveEngine engine(std::make_shared<const ModelSet>(models));
      Noise noise(4);
      std::vector<Transition> names;
      for (std::uint64_t k = 0; k < 240; ++k) {
        Sample sample = PlantSample(k, swing);
        noise.Add(sample);
        if (k >= 205) {
          AddF6(sample, 1.0);
        }
        for (const Transition& t : engine.Step(sample).Transitions()) {
          if (t.kind != TransitionKind::kDetected) {
            names.push_back(t);
          }
        }
      }
      const auto seconds = [](const Transition& t) {
        return static_cast<double>(t.stamp_ns - t.detection_stamp_ns) * 1e-9;
      };
      ASSERT_FALSE(names.empty());
      EXPECT_EQ(names.back().faults, swing > 0.0 ? 0b100U : 0b110U);
      if (error == 0.0) {
        EXPECT_EQ(names.size(), 1U);
        EXPECT_GE(seconds(names[0]), 29.0);
        continue;
      }
      EXPECT_GE(seconds(names[0]), 2.0) << "the next samples bear it out";
      EXPECT_LE(seconds(names[0]), 5.0);
      EXPECT_NE(names[0].faults & 0b100U, 0U);
      EXPECT_LE(seconds(names.back()), swing > 0.0 ? 15.0 : 5.0);
    }
  }
}

// A reading at the limit of its transmitter, where the fault predicts more, is
// what it explains: no residual, and normal operation has one.
TEST(ValveEngineTest, AReadingAtItsLimitIsExplainedAtOnce) {
  constexpr double kFlowLimit = 55.0;
  ModelSet models = tests::LinearPlant();
  models.decision.isolation_samples = 30;
  models.decision.early_error = 1e-3;
  for (Observer& observer : models.observers) {
    observer.channels[1].model.saturation = kFlowLimit;
  }
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(5);
  std::vector<Transition> names;
  for (std::uint64_t k = 0; k < 225; ++k) {
    Sample sample = PlantSample(k, 0.0);
    noise.Add(sample);
    if (k >= 205) {
      AddF6(sample, 1.0);
    }
    double& flow = sample.values[Index(Signal::kF)];
    flow = std::min(flow, kFlowLimit);
    for (const Transition& t : engine.Step(sample).Transitions()) {
      if (t.kind != TransitionKind::kDetected) {
        names.push_back(t);
      }
    }
  }
  ASSERT_FALSE(names.empty());
  EXPECT_EQ(names.front().faults, 0b110U);  // f3 and f6
}

}  // namespace
}  // namespace fdi
