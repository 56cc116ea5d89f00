#include "diagnosis/observers/coverage.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::kNoise;
using tests::LinearModel;

constexpr double kP1 = 3550.0;
constexpr double kP2 = 2650.0;
constexpr double kT1 = 100.0;
constexpr int kRearm = 60;

ChannelObserver Constant(Signal output, double value) {
  ChannelObserver channel = LinearModel(output, 0.0, value);
  channel.model.output_max = 1e4;
  return channel;
}

// The linear plant with its inputs held against their normal band.
ModelSet OperatedPlant() {
  ModelSet models = tests::LinearPlant();
  models.channels.push_back({"T1", Signal::kT1, -5.0, 5.0});
  models.channels.push_back({"P1", Signal::kP1, -200.0, 200.0});
  models.channels.push_back({"P2", Signal::kP2, -200.0, 200.0});
  for (Observer& observer : models.observers) {
    observer.channels.push_back(Constant(Signal::kT1, kT1));
    observer.channels.push_back(Constant(Signal::kP1, kP1));
    observer.channels.push_back(Constant(Signal::kP2, kP2));
  }
  models.validity.cv = {40.0, 80.0};
  models.validity.cv_step = 10.0;
  models.validity.dp = {600.0, 1200.0};
  models.validity.flow_cutoff = 1.0;
  models.validity.rearm_samples = kRearm;
  return models;
}

struct Process {
  double cv{60.0};
  double p1{kP1};
  double t1{kT1};
  ValveMode mode{ValveMode::kAuto};
  double f6{0.0};
};

// X = CV; F = (100 − CV) √(dP/900): as the models say at the usual pressure.
Sample At(int k, const Process& process) {
  Sample sample;
  sample.stamp_ns = (k + 1LL) * 1'000'000'000;
  sample.source_id = 7;
  sample.seq = static_cast<std::uint64_t>(k);
  sample.mode = process.mode;
  const double wave = process.cv > 5.0 && process.cv < 95.0 ? 2.0 : 0.0;
  const double cv = process.cv + wave * std::sin(0.2 * k);
  const double dp = std::max(process.p1 - kP2, 0.0);
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kP1, process.p1);
  sample.Set(Signal::kP2, kP2);
  sample.Set(Signal::kT1, process.t1);
  sample.Set(Signal::kX, cv);
  sample.Set(Signal::kF,
             (100.0 - cv) * std::sqrt(dp / 900.0) + 20.0 * process.f6);
  return sample;
}

using History = std::function<Process(int)>;

struct Outcome {
  int episodes{0};
  int live{0};
  std::set<std::string> reasons;
  Verdict last;
  std::vector<Transition> transitions;
};

Outcome Follow(ValveEngine& engine, int begin, int end,
               const History& history) {
  tests::Noise noise(static_cast<std::uint64_t>(begin + 1));
  Outcome outcome;
  for (int k = begin; k < end; ++k) {
    Sample sample = At(k, history(k));
    noise.Add(sample);
    outcome.last = engine.Step(sample);
    outcome.live += outcome.last.quality == Quality::kLive ? 1 : 0;
    outcome.reasons.insert(CoverageReasonsName(outcome.last.uncovered));
    for (const Transition& transition : outcome.last.Transitions()) {
      outcome.episodes += transition.kind == TransitionKind::kDetected ? 1 : 0;
      outcome.transitions.push_back(transition);
    }
  }
  return outcome;
}

ValveEngine Engine(const ModelSet& models = OperatedPlant()) {
  return ValveEngine(std::make_shared<const ModelSet>(models));
}

History Constantly(const Process& process) {
  return [=](int) { return process; };
}

// Linear from a to b between the samples first and last.
double Ramp(int k, int first, int last, double a, double b) {
  const double share =
      std::clamp(static_cast<double>(k - first) / (last - first), 0.0, 1.0);
  return a + (b - a) * share;
}

// The valve opens in 2 min, P1 rises in 10, T1 in 20.
TEST(CoverageTest, StartUpIsNoBrokenThermometer) {
  ValveEngine engine = Engine();
  const Outcome outcome = Follow(engine, 0, 5000, [](int k) {
    Process process;
    process.cv = Ramp(k, 0, 120, 100.0, 60.0);
    process.p1 = Ramp(k, 0, 600, kP2, kP1);
    process.t1 = Ramp(k, 0, 1200, 20.0, kT1);
    return process;
  });
  EXPECT_EQ(outcome.episodes, 0);
  EXPECT_TRUE(outcome.reasons.contains("cv|dp|t1|p1"));
  EXPECT_TRUE(outcome.reasons.contains("t1"));
  EXPECT_EQ(outcome.last.quality, Quality::kLive);
  EXPECT_GT(outcome.live, 5000 - 1200 - kRearm);
}

TEST(CoverageTest, ShutdownIsNoFault) {
  ValveEngine engine = Engine();
  const Outcome outcome = Follow(engine, 0, 2000, [](int k) {
    Process process;
    process.cv = Ramp(k, 600, 900, 60.0, 100.0);
    process.p1 = Ramp(k, 900, 1000, kP1, kP2);
    process.t1 = Ramp(k, 900, 2000, kT1, 40.0);
    return process;
  });
  EXPECT_EQ(outcome.episodes, 0);
  EXPECT_GT(outcome.live, 600);
  EXPECT_EQ(outcome.last.quality, Quality::kUncovered);
}

// Even where the closed valve was seen in training.
TEST(CoverageTest, ParkedValveIsNotJudged) {
  ModelSet models = OperatedPlant();
  models.validity.cv = {40.0, 105.0};
  ValveEngine engine = Engine(models);
  const Outcome outcome = Follow(engine, 0, 3600, [](int k) {
    Process process;
    process.cv = Ramp(k, 300, 340, 60.0, 100.0);
    process.p1 = Ramp(k, 600, 605, kP1, kP2);  // the pump stops later
    return process;
  });
  EXPECT_EQ(outcome.episodes, 0);
  EXPECT_TRUE(outcome.reasons.contains("parked"));
  EXPECT_EQ(outcome.last.quality, Quality::kUncovered);
}

// Pressure across an open valve and no flow: that is no way to park.
TEST(CoverageTest, OpenValveIsParkedOnlyWithoutPressure) {
  ModelSet models = OperatedPlant();
  models.validity.cv = {-5.0, 105.0};
  for (const double p1 : {kP1, kP2}) {
    Coverage coverage(models);
    ObserverBank bank(models);
    Process process;
    process.cv = 0.0;
    process.p1 = p1;
    bank.Initialise(At(0, process));
    for (int k = 0; k < kRearm; ++k) {
      Sample sample = At(k, process);
      sample.Set(Signal::kF, 0.0);
      bank.Step(sample);
      coverage.Judge(sample, bank, false);
    }
    EXPECT_EQ(coverage.reasons() & BitOf(CoverageReason::kParked),
              p1 == kP2 ? BitOf(CoverageReason::kParked) : 0);
  }
}

// 60 s each; the rod takes seconds, the pressures give way.
TEST(CoverageTest, StrokeTestInAutomaticModeIsNoFault) {
  ValveEngine engine = Engine();
  const std::vector<double> strokes{0, 25, 50, 75, 100, 75, 50, 25, 0};
  tests::Noise noise(1);
  double x = 60.0;
  for (int k = 0; k < 2500; ++k) {
    Process process;
    const int stroke = (k - 600) / 60;
    if (k >= 600 && stroke < 9) {
      process.cv = strokes[static_cast<std::size_t>(stroke)];
      process.p1 = kP1 - 3.0 * (60.0 - process.cv);
    }
    Sample sample = At(k, process);
    const double cv = sample[Signal::kCv];
    x += std::clamp(cv - x, -8.0, 8.0);
    sample.Set(Signal::kX, x);
    noise.Add(sample);
    const Verdict& verdict = engine.Step(sample);
    EXPECT_EQ(verdict.transition_count, 0) << k;
    EXPECT_TRUE(k < 100 || k >= 600 || verdict.quality == Quality::kLive);
  }
  EXPECT_FALSE(engine.episode_open());
}

// A smooth command in training: a step within its range is none of it.
TEST(CoverageTest, StepUnlikeAnyInTrainingDisarms) {
  ValveEngine engine = Engine();
  const Outcome before = Follow(engine, 0, 100, Constantly({}));
  const Outcome after = Follow(engine, 100, 101, Constantly({75.0}));
  EXPECT_EQ(before.last.quality, Quality::kLive);
  EXPECT_EQ(CoverageReasonsName(after.last.uncovered), "cv_step");
}

TEST(CoverageTest, ManualModeIsInhibitedAndTakesTheFullTimeToArm) {
  ValveEngine engine = Engine();
  Follow(engine, 0, 100, Constantly({}));
  const Outcome manual = Follow(engine, 100, 3700, [](int k) {
    Process process;
    process.mode = ValveMode::kManual;
    process.cv = 60.0 - 20.0 * (k / 600 % 3);
    process.f6 = 1.0;
    return process;
  });
  EXPECT_EQ(manual.episodes, 0);
  EXPECT_EQ(manual.live, 0);
  EXPECT_EQ(manual.last.quality, Quality::kInhibited);
  const Outcome waiting = Follow(engine, 3700, 3700 + kRearm, Constantly({}));
  EXPECT_EQ(waiting.live, 0);
  EXPECT_EQ(CoverageReasonsName(waiting.last.uncovered), "waiting");
  EXPECT_EQ(Follow(engine, 3760, 3761, Constantly({})).last.quality,
            Quality::kLive);
}

TEST(CoverageTest, NewStreamIsJudgedAfterSettling) {
  ValveEngine engine = Engine();
  EXPECT_EQ(Follow(engine, 0, kMaxLag, Constantly({})).live, 0);
  EXPECT_EQ(Follow(engine, kMaxLag, kMaxLag + 5, Constantly({})).live, 5);
}

TEST(CoverageTest, InputsOfAnArmedValveAreJudged) {
  for (const bool temperature : {false, true}) {
    ValveEngine engine = Engine();
    Follow(engine, 0, 100, Constantly({}));
    Process broken;
    (temperature ? broken.t1 : broken.p1) = temperature ? 150.0 : kP2;
    const Outcome outcome = Follow(engine, 100, 200, Constantly(broken));
    EXPECT_EQ(outcome.episodes, 1);
    EXPECT_EQ(outcome.live, 100);
  }
}

TEST(CoverageTest, OpenEpisodeWaitsOutside) {
  ValveEngine engine = Engine();
  Follow(engine, 0, 100, Constantly({}));
  Process fault;
  fault.f6 = 1.0;
  const Outcome seen = Follow(engine, 100, 200, Constantly(fault));
  ASSERT_EQ(seen.last.state, State::kIsolated);
  const Outcome outside = Follow(engine, 200, 400, Constantly({90.0}));
  EXPECT_TRUE(outside.transitions.empty());
  EXPECT_EQ(outside.last.isolated, seen.last.isolated);
  const Outcome back = Follow(engine, 400, 600, Constantly({}));
  ASSERT_FALSE(back.transitions.empty());
  EXPECT_EQ(back.transitions.back().reason, EndReason::kCleared);
}

// A signal that was off when the episode was judged need not recover first.
TEST(CoverageTest, SignalAtFaultDoesNotKeepItsEpisodeFromBeingJudged) {
  ValveEngine engine = Engine();
  Follow(engine, 0, 100, Constantly({}));
  Process broken;
  broken.t1 = 150.0;
  Follow(engine, 100, 200, Constantly(broken));
  ASSERT_TRUE(engine.episode_open());
  broken.cv = 90.0;
  Follow(engine, 200, 210, Constantly(broken));
  broken.cv = 60.0;
  EXPECT_EQ(Follow(engine, 210, 211, Constantly(broken)).live, 0);
  // The step back is the last sample outside.
  EXPECT_EQ(Follow(engine, 211, 400, Constantly(broken)).live, 189 - kRearm);
}

TEST(CoverageTest, LostSamplesDoNotDisarm) {
  Process broken;
  broken.t1 = 150.0;
  for (const int gap : {5, 700}) {
    ValveEngine engine = Engine();
    Follow(engine, 0, 100, Constantly({}));
    Follow(engine, 100, 200, Constantly(broken));
    const Outcome outcome =
        Follow(engine, 200 + gap, 400 + gap, Constantly(broken));
    EXPECT_EQ(outcome.live, gap == 5 ? 200 - kMaxLag : 0) << gap;
  }
}

TEST(CoverageTest, WindowsBeginAnewOnceArmedAndOutlastLostSamples) {
  ModelSet models = OperatedPlant();
  models.channels[1].windows = {{100, -0.6 * kNoise, 0.6 * kNoise, 3.0}};
  Process drift;
  drift.f6 = kNoise / 20.0;  // one deviation
  for (const bool outside : {false, true}) {
    ValveEngine engine = Engine(models);
    Follow(engine, 0, 300, Constantly({}));
    Follow(engine, 300, 345, Constantly(drift));
    // Twenty samples are lost, or the command leaves the range for as many.
    int k = 365;
    if (outside) {
      Follow(engine, 345, 365, Constantly({90.0}));
      EXPECT_EQ(Follow(engine, 365, 365 + kRearm, Constantly(drift)).live, 0);
      k = 365 + kRearm;
    }
    const int first = k;
    while (!engine.episode_open() && k < first + 400) {
      Follow(engine, k, k + 1, Constantly(drift));
      ++k;
    }
    EXPECT_TRUE(engine.episode_open());
    EXPECT_EQ(k - first > 99, outside) << k - first;
  }
}

// A controller that moves the command by much passes the end of the range now
// and then. The valve is not judged while an observer may read that command,
// and is what it was before.
TEST(CoverageTest, CommandThatPassesTheEndOfTheRangeDoesNotDisarm) {
  ModelSet models = OperatedPlant();
  models.validity.cv_step = 50.0;
  constexpr int kLag = 5;
  models.observers[1].channels[0].model.regressors[0].lag = kLag;
  const auto passing = [](int samples) {
    return [=](int k) {
      Process process;
      process.cv = k < 300 + samples && k >= 300 ? 90.0 : 60.0;
      return process;
    };
  };
  ValveEngine engine = Engine(models);
  Follow(engine, 0, 300, passing(2));
  const Outcome passed = Follow(engine, 300, 302 + kLag, passing(2));
  EXPECT_EQ(passed.live, 0);
  EXPECT_EQ(passed.reasons, (std::set<std::string>{"cv", "waiting"}));
  EXPECT_EQ(Follow(engine, 302 + kLag, 400, passing(2)).live, 98 - kLag);
  // It stays, until its mean is beyond, too.
  ValveEngine staying = Engine(models);
  Follow(staying, 0, 300, passing(30));
  Follow(staying, 300, 330, passing(30));
  EXPECT_EQ(Follow(staying, 330, 330 + kRearm, passing(30)).live, 0);
}

TEST(CoverageTest, ArmedStateIsPartOfTheSnapshot) {
  Process broken;
  broken.t1 = 150.0;
  ValveEngine before = Engine();
  Follow(before, 0, 100, Constantly({}));
  for (const bool restored : {false, true}) {
    ValveEngine after = Engine();
    if (restored) {
      ASSERT_TRUE(after.Restore(before.Save()));
    }
    EXPECT_EQ(Follow(after, 150, 250, Constantly(broken)).episodes,
              restored ? 1 : 0);
  }
}

TEST(CoverageTest, ReasonsAreNamed) {
  EXPECT_EQ(CoverageReasonsName(0), "");
  EXPECT_EQ(CoverageReasonsName(static_cast<CoverageReasons>(
                BitOf(CoverageReason::kMode) | BitOf(CoverageReason::kP2))),
            "mode|p2");
}

}  // namespace
}  // namespace fdi
