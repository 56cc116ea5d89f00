#include "diagnosis/detection.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "diagnosis/valve_engine.h"
#include "tests/diagnosis/engine_run.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::AddF6;
using tests::Noise;
using tests::PlantSample;
using tests::Seen;
using tests::SharedPlant;
using tests::StepRange;

// A shift of one deviation passes no threshold, its mean does.
TEST(DetectionTest, WindowFindsWhatNoThresholdSees) {
  ModelSet models = *SharedPlant();
  for (const bool watched : {false, true}) {
    if (watched) {
      models.channels[1].windows = {
          {50, -0.6 * tests::kNoise, 0.6 * tests::kNoise, 3.0}};
    }
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    Noise noise(5);
    const auto add = [&](Sample& s) { noise.Add(s); };
    EXPECT_TRUE(StepRange(engine, 0, 300, add).transitions.empty());
    const Seen seen = StepRange(engine, 300, 600, [&](Sample& s) {
      noise.Add(s);
      AddF6(s, tests::kNoise / 20.0);
    });
    EXPECT_EQ(!seen.transitions.empty(), watched);
  }
}

// Twice the noise on F: the mean stays, the energy does not.
TEST(DetectionTest, EnergyOfAWindowIsWatchedUpwards) {
  ModelSet models = *SharedPlant();
  models.channels[1].lower_threshold = -100.0;
  models.channels[1].upper_threshold = 100.0;
  models.channels[1].windows = {
      {50, -10.0, 10.0, std::log(1.5 * tests::kNoise)}};
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

// An error of the model at one end of the range, where CV never stayed in
// training, is no drift; at the usual place it is.
TEST(DetectionTest, WindowHoldsForTheCommandsItWasFittedTo) {
  ModelSet models = *SharedPlant();
  WindowLimits limits{30, -0.5, 0.5, 10.0};
  limits.command = {45.0, 60.0};
  models.channels[1].windows = {limits};
  for (const double cv : {50.0, 75.0}) {
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    for (std::uint64_t k = 0; k < 200; ++k) {
      Sample sample = PlantSample(k, 0.0);
      sample.Set(Signal::kCv, cv);
      sample.Set(Signal::kX, cv);
      sample.Set(Signal::kF, 101.0 - cv);  // threshold 2
      engine.Step(sample);
    }
    EXPECT_EQ(engine.episode_open(), cv == 50.0);
  }
}

// A model that errs by a share of what the command does.
TEST(DetectionTest, LimitOnEnergyFollowsTheExcitation) {
  ModelSet models = *SharedPlant();
  models.channels[1].lower_threshold = -100.0;
  models.channels[1].upper_threshold = 100.0;
  WindowLimits limits{80, -10.0, 10.0, std::log(1.5)};
  limits.activity_slope = 1.0;
  limits.log_activity = std::log(10.0 / std::sqrt(2.0));
  const auto detects = [&](double slope, double swing, double error) {
    limits.activity_slope = slope;
    models.channels[1].windows = {limits};
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    for (std::uint64_t k = 0; k < 400; ++k) {
      // Deviation 1 of the residual at a swing of 10 and an error of 0.14.
      Sample sample = PlantSample(k, swing);
      sample.values[Index(Signal::kF)] += error * (sample[Signal::kCv] - 50.0);
      engine.Step(sample);
    }
    return engine.episode_open();
  };
  EXPECT_FALSE(detects(1.0, 10.0, 0.14));
  EXPECT_FALSE(detects(1.0, 20.0, 0.14));
  EXPECT_TRUE(detects(0.0, 20.0, 0.14));
  EXPECT_TRUE(detects(1.0, 10.0, 0.28));
  // Upwards only: a valve at rest is held to the limit as fitted.
  EXPECT_FALSE(detects(1.0, 2.0, 0.14));
}

constexpr double kLimit = 0.6 * tests::kNoise;  // on the mean of F
constexpr int kHour = 3600;

std::shared_ptr<const ModelSet> DriftingPlant(const DriftLimits& drift) {
  ModelSet models = *SharedPlant();
  models.channels[1].lower_threshold = -100.0;
  models.channels[1].upper_threshold = 100.0;
  models.channels[1].windows = {
      {100, -kLimit, kLimit, std::log(1.5 * tests::kNoise)}};
  models.channels[1].drift = drift;
  return std::make_shared<const ModelSet>(models);
}

const DriftLimits kFollowed{-2.0 * kLimit, 2.0 * kLimit, std::log(2.0)};

// Hour of the first alarm while F is raised by `shift` limits and its noise
// grows by `growth` each hour; nothing if there is none in 24 h.
std::optional<double> AlarmAfter(const DriftLimits& drift, double shift,
                                 double growth) {
  ValveEngine engine(DriftingPlant(drift));
  Noise noise(9);
  for (int k = 0; k < 24 * kHour; ++k) {
    const double hours = static_cast<double>(k) / kHour;
    Sample sample = PlantSample(static_cast<std::uint64_t>(k));
    const double flow = sample[Signal::kF];
    noise.Add(sample);
    sample.values[Index(Signal::kF)] =
        flow + (sample[Signal::kF] - flow) * (1.0 + growth * hours) +
        shift * hours * kLimit;
    if (engine.Step(sample).detected) {
      return hours;
    }
  }
  return std::nullopt;
}

// One limit takes 12 h, 8 h are followed; then 4 h.
TEST(DriftTest, SlowShiftIsFollowedAndQuickOneIsNot) {
  EXPECT_FALSE(AlarmAfter(kFollowed, 1.0 / 12.0, 0.0).has_value());
  const auto unfollowed = AlarmAfter(DriftLimits{}, 1.0 / 12.0, 0.0);
  ASSERT_TRUE(unfollowed.has_value());
  EXPECT_LT(*unfollowed, 12.0);
  const auto quick = AlarmAfter(kFollowed, 1.0 / 4.0, 0.0);
  ASSERT_TRUE(quick.has_value());
  EXPECT_LT(*quick, 9.0);
}

TEST(DriftTest, SlowRiseOfTheNoiseIsFollowed) {
  EXPECT_FALSE(AlarmAfter(kFollowed, 0.0, 1.0 / 20.0).has_value());
  EXPECT_TRUE(AlarmAfter(DriftLimits{}, 0.0, 1.0 / 20.0).has_value());
}

TEST(DriftTest, NoMoreIsFollowedThanTheSetAllows) {
  const DriftLimits less{-kLimit, 0.5 * kLimit, 0.0};
  const auto alarm = AlarmAfter(less, 1.0 / 10.0, 0.0);
  ASSERT_TRUE(alarm.has_value());
  EXPECT_GT(*alarm, 10.0);
  EXPECT_LT(*alarm, 15.0);
}

// F is raised by a limit in 10 h, without noise. The window lags by its 100
// samples, which are 0.003 limits.
TEST(DriftTest, TellsHowFarItHasFollowed) {
  ValveEngine engine(DriftingPlant(kFollowed));
  const auto drifts = [](Sample& s) {
    s.values[Index(Signal::kF)] +=
        kLimit * static_cast<double>(s.seq) / (10.0 * kHour);
  };
  StepRange(engine, 0, kHour, drifts);
  EXPECT_EQ(engine.followed_drift(1).mean, 0.0);
  StepRange(engine, kHour, 10 * kHour, drifts);

  const FollowedDrift half = engine.followed_drift(1);
  EXPECT_NEAR(half.mean, kLimit, 0.01 * kLimit);
  EXPECT_EQ(half.mean_bound, 2.0 * kLimit);
  EXPECT_EQ(half.mean_used(), half.mean / half.mean_bound);
  EXPECT_EQ(half.mean_full_ns, 0);
  EXPECT_EQ(half.log_scale, 0.0);
  EXPECT_EQ(half.log_scale_bound, std::log(2.0));
  EXPECT_EQ(engine.followed_drift(0).used(), 0.0);  // X has no windows.
}

// Downwards, where the bound is half a limit and one is reached in 10 h; then
// back. Steps of equal size run behind windows with noise, here by 1.3 of their
// deviations, 0.15 limits. That windows waver at the bound begins nothing anew.
TEST(DriftTest, TellsSinceWhenItIsAtItsBound) {
  const DriftLimits less{-0.5 * kLimit, 3.0 * kLimit, 0.0};
  ValveEngine engine(DriftingPlant(less));
  Noise noise(9);
  const auto drifts = [&](Sample& s) {
    noise.Add(s);
    const double hours = static_cast<double>(s.seq) / kHour;
    s.values[Index(Signal::kF)] -=
        kLimit * std::min(hours, 16.0 - hours) / 10.0;
  };
  std::int64_t since_ns = 0;
  for (int hour = 0; hour < 9; ++hour) {
    ASSERT_TRUE(StepRange(engine, hour * kHour, (hour + 1) * kHour, drifts)
                    .transitions.empty());
    const FollowedDrift drift = engine.followed_drift(1);
    EXPECT_GE(drift.mean, less.lower_mean);
    EXPECT_EQ(drift.mean_bound, hour > 0 ? less.lower_mean : less.upper_mean);
    EXPECT_EQ(drift.mean_full_ns != 0, hour >= 6) << hour;
    EXPECT_TRUE(since_ns == 0 || drift.mean_full_ns == since_ns) << hour;
    since_ns = drift.mean_full_ns;
  }
  EXPECT_NEAR(static_cast<double>(since_ns), 6.5e9 * kHour, 0.5e9 * kHour);
  StepRange(engine, 9 * kHour, 16 * kHour, drifts);

  EXPECT_GT(engine.followed_drift(1).mean, 0.5 * less.lower_mean);
  EXPECT_EQ(engine.followed_drift(1).mean_full_ns, 0);
}

TEST(DriftTest, TellsHowFarItHasFollowedTheNoise) {
  ValveEngine engine(DriftingPlant({0.0, 0.0, std::log(1.2)}));
  Noise noise(9);
  StepRange(engine, 0, 12 * kHour, [&](Sample& s) {
    const double flow = s[Signal::kF];
    noise.Add(s);
    const double hours = static_cast<double>(s.seq) / kHour;
    s.values[Index(Signal::kF)] +=
        (s[Signal::kF] - flow) * std::min(0.05 * hours, 0.4);
  });

  const FollowedDrift drift = engine.followed_drift(1);
  EXPECT_EQ(drift.log_scale, std::log(1.2));
  EXPECT_EQ(drift.scale_used(), 1.0);
  EXPECT_GT(drift.scale_full_ns, 0);
  EXPECT_EQ(drift.mean_used(), 0.0);
}

// F goes on rising while X is faulty.
TEST(DriftTest, WhatIsToldStopsAtAnAlarm) {
  ValveEngine engine(DriftingPlant(kFollowed));
  const auto drifts = [&](Sample& s) {
    s.values[Index(Signal::kF)] +=
        kLimit * static_cast<double>(s.seq) / (10.0 * kHour);
  };
  StepRange(engine, 0, 5 * kHour, drifts);
  StepRange(engine, 5 * kHour, 5 * kHour + 10, [&](Sample& s) {
    drifts(s);
    s.values[Index(Signal::kX)] -= 10.0;
  });
  ASSERT_TRUE(engine.episode_open());
  const double before = engine.followed_drift(1).mean;
  ASSERT_GT(before, 0.4 * kLimit);
  StepRange(engine, 5 * kHour + 10, 8 * kHour, [&](Sample& s) {
    drifts(s);
    s.values[Index(Signal::kX)] -= 10.0;
  });

  EXPECT_EQ(engine.followed_drift(1).mean, before);
}

// F is shifted by `shift` limits for `hours`, then as far the other way, which
// is an alarm if the first shift was learnt. X is faulty until then, or not:
// off at every 15th sample, which lets no episode clear.
bool LearnsShift(double shift, double hours, bool faulty) {
  ValveEngine engine(DriftingPlant(kFollowed));
  const int until = static_cast<int>(hours * kHour);
  StepRange(engine, 0, until, [&](Sample& s) {
    const auto k = static_cast<int>(s.seq);
    const bool off = k == 100 || k % 15 == 11;  // 100, 101, 116, ...
    s.values[Index(Signal::kX)] -= faulty && off ? 10.0 : 0.0;
    s.values[Index(Signal::kF)] += shift * kLimit;
  });
  EXPECT_EQ(engine.episode_open(), faulty);
  StepRange(engine, until, until + 60);
  EXPECT_FALSE(engine.episode_open());
  return !StepRange(engine, until + 60, until + 2000, [&](Sample& s) {
            s.values[Index(Signal::kF)] -= shift * kLimit;
          }).transitions.empty();
}

TEST(DriftTest, NothingIsLearntInTheFirstHour) {
  EXPECT_FALSE(LearnsShift(0.95, 1.0, false));
  EXPECT_TRUE(LearnsShift(0.95, 3.0, false));
}

TEST(DriftTest, NothingIsLearntDuringAnEpisode) {
  EXPECT_FALSE(LearnsShift(0.95, 10.0, true));
  EXPECT_TRUE(LearnsShift(0.95, 10.0, false));
}

// Had the fault been learnt, the repaired valve would be abnormal.
TEST(DriftTest, FaultIsNotLearnt) {
  ModelSet models = *DriftingPlant(kFollowed);
  models.channels[1].lower_threshold = -4.0 * tests::kNoise;
  models.channels[1].upper_threshold = 4.0 * tests::kNoise;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  Noise noise(10);
  const auto healthy = [&](Sample& s) { noise.Add(s); };
  EXPECT_TRUE(StepRange(engine, 0, kHour, healthy).transitions.empty());
  StepRange(engine, kHour, 20 * kHour, [&](Sample& s) {
    noise.Add(s);
    AddF6(s, 0.5);
  });
  ASSERT_TRUE(engine.episode_open());
  StepRange(engine, 20 * kHour, 20 * kHour + 400, healthy);
  EXPECT_FALSE(engine.episode_open());
  EXPECT_TRUE(StepRange(engine, 20 * kHour + 400, 21 * kHour, healthy)
                  .transitions.empty());
}

// Reading and prediction at the limit of the flow transmitter say nothing; a
// reading below it does.
TEST(DetectionTest, SaturatedChannelAbstains) {
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

}  // namespace
}  // namespace fdi
