#include "diagnosis/valve_engine.h"

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/error.h"
#include "tests/diagnosis/allocation_count.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using testing::AddF3;
using testing::AddF6;
using testing::Noise;
using testing::PlantSample;
using testing::SharedPlant;

constexpr int kSettled = kMaxLag;  // samples before LIVE

struct Seen {
  std::vector<Transition> transitions;
  Verdict last;
};

// Steps samples [begin, end) with `change` applied to each.
Seen StepRange(ValveEngine& engine, int begin, int end,
               const std::function<void(Sample&)>& change = {}) {
  Seen seen;
  for (int k = begin; k < end; ++k) {
    Sample sample = PlantSample(static_cast<std::uint64_t>(k));
    if (change) {
      change(sample);
    }
    seen.last = engine.Step(sample);
    for (const Transition& transition : seen.last.Transitions()) {
      seen.transitions.push_back(transition);
    }
  }
  return seen;
}

std::int64_t StampOf(int k) {
  return PlantSample(static_cast<std::uint64_t>(k)).stamp_ns;
}

void FullF6(Sample& sample) {
  AddF6(sample, 1.0);
}

// A shift of one deviation passes no threshold, its mean does.
TEST(ValveEngineTest, WindowFindsWhatNoThresholdSees) {
  ModelSet models = *SharedPlant();
  for (const bool watched : {false, true}) {
    if (watched) {
      models.channels[1].windows = {
          {50, -0.6 * testing::kNoise, 0.6 * testing::kNoise, 3.0}};
    }
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    Noise noise(5);
    const auto add = [&](Sample& s) { noise.Add(s); };
    EXPECT_TRUE(StepRange(engine, 0, 300, add).transitions.empty());
    const Seen seen = StepRange(engine, 300, 600, [&](Sample& s) {
      noise.Add(s);
      AddF6(s, testing::kNoise / 20.0);
    });
    EXPECT_EQ(!seen.transitions.empty(), watched);
  }
}

// Twice the noise on F: the mean stays, the energy does not.
TEST(ValveEngineTest, EnergyOfAWindowIsWatchedUpwards) {
  ModelSet models = *SharedPlant();
  models.channels[1].lower_threshold = -100.0;
  models.channels[1].upper_threshold = 100.0;
  models.channels[1].windows = {
      {50, -10.0, 10.0, std::log(1.5 * testing::kNoise)}};
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(6);
  const auto add = [&](Sample& s) { noise.Add(s); };
  EXPECT_TRUE(StepRange(engine, 0, 300, add).transitions.empty());
  const Seen seen = StepRange(engine, 300, 500, [&](Sample& s) {
    const double flow = s[Signal::kF];
    noise.Add(s);
    s.values[Index(Signal::kF)] = flow + 2.0 * (s[Signal::kF] - flow);
  });
  ASSERT_FALSE(seen.transitions.empty());
  EXPECT_EQ(seen.transitions[0].kind, TransitionKind::kDetected);
}

// Reading and prediction at the limit of the flow transmitter say nothing; a
// reading below it does.
TEST(ValveEngineTest, SaturatedChannelAbstains) {
  ModelSet models = *SharedPlant();
  for (Observer& observer : models.observers) {
    observer.channels[1].model.saturation = 60.0;
  }
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  const auto clip = [](Sample& s) {
    s.values[Index(Signal::kF)] = std::min(s[Signal::kF], 60.0);
  };
  bool abstained = false;
  for (int k = 0; k < 300; ++k) {
    Sample sample = PlantSample(static_cast<std::uint64_t>(k));
    clip(sample);
    const Verdict& verdict = engine.Step(sample);
    EXPECT_EQ(verdict.transition_count, 0);
    abstained = abstained || std::isnan(verdict.residuals[1]);
  }
  EXPECT_TRUE(abstained);
  const Seen seen = StepRange(
      engine, 300, 320, [](Sample& s) { s.values[Index(Signal::kF)] = 40.0; });
  EXPECT_TRUE(seen.last.detected);
}

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

TEST(ValveEngineTest, RepeatedAndLateSamplesChangeNothing) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 60);
  ValveEngine twin(SharedPlant());
  StepRange(twin, 0, 60);
  Sample repeat = PlantSample(59);
  AddF6(repeat, 1.0);
  EXPECT_EQ(engine.Step(repeat).intake, Intake::kRepeat);
  EXPECT_EQ(engine.Step(PlantSample(10)).intake, Intake::kLate);
  const Verdict after = engine.Step(PlantSample(60));
  const Verdict expected = twin.Step(PlantSample(60));
  EXPECT_EQ(after.residuals[1], expected.residuals[1]);
  EXPECT_EQ(after.quality, Quality::kLive);
}

TEST(ValveEngineTest, GapSettlesAnewAndTakesNoDecision) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen gap = StepRange(engine, 53, 54, FullF6);
  EXPECT_TRUE(gap.last.initialised);
  EXPECT_EQ(gap.last.quality, Quality::kSettling);
  const Seen settling = StepRange(engine, 54, 53 + kSettled, FullF6);
  EXPECT_TRUE(settling.transitions.empty());
  const Seen live = StepRange(engine, 53 + kSettled, 60 + kSettled, FullF6);
  ASSERT_EQ(live.transitions.size(), 1U);
}

TEST(ValveEngineTest, BadValuesNeverReachAnObserver) {
  const struct {
    double value;
    Intake intake;
  } cases[] = {{std::nan(""), Intake::kNotFinite},
               {std::numeric_limits<double>::infinity(), Intake::kNotFinite},
               {-100.0, Intake::kRange}};
  for (const auto& bad : cases) {
    ValveEngine engine(SharedPlant());
    StepRange(engine, 0, 50);
    Sample sample = PlantSample(50);
    sample.Set(Signal::kF, bad.value);
    const Verdict verdict = engine.Step(sample);
    EXPECT_EQ(verdict.intake, bad.intake);
    EXPECT_EQ(verdict.quality, Quality::kBadInput);
    EXPECT_TRUE(engine.Step(PlantSample(51)).initialised);
  }
}

TEST(ValveEngineTest, BadQualityIsRefused) {
  ValveEngine engine(SharedPlant());
  Sample sample = PlantSample(0);
  sample.quality[Index(Signal::kF)] = SignalQuality::kBad;
  EXPECT_EQ(engine.Step(sample).intake, Intake::kBadQuality);
}

TEST(ValveEngineTest, AnotherFlowUnitIsRefused) {
  ValveEngine engine(SharedPlant());
  Sample sample = PlantSample(0);
  sample.flow_unit = FlowUnit::kTPerHour;
  EXPECT_EQ(engine.Step(sample).intake, Intake::kUnit);
}

TEST(ValveEngineTest, ChannelWithoutItsSignalAbstains) {
  ValveEngine engine(SharedPlant());
  const auto without_flow = [](Sample& s) {
    s.present = static_cast<SignalMask>(s.present & ~MaskOf(Signal::kF));
  };
  StepRange(engine, 0, 50, without_flow);
  const Seen seen = StepRange(engine, 50, 80, [&](Sample& s) {
    without_flow(s);
    s.values[Index(Signal::kX)] -= 20.0;
  });
  EXPECT_EQ(seen.last.confidence, 0.5);
  EXPECT_TRUE(std::isnan(seen.last.residuals[1]));
  EXPECT_EQ(FaultSetName(engine.models(), seen.last.isolated), "f1");
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
  const long before = testing::AllocationCount();
  for (const Sample& sample : samples) {
    engine.Step(sample);
  }
  EXPECT_EQ(testing::AllocationCount() - before, 0);
}

TEST(ValveEngineTest, UnusableModelSetIsRefused) {
  ModelSet models = testing::LinearPlant();
  models.channels[0].upper_threshold = -1.0;
  EXPECT_THROW(ValveEngine(std::make_shared<const ModelSet>(models)),
               DataError);
}

}  // namespace
}  // namespace fdi
