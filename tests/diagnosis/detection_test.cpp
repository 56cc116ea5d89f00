#include "diagnosis/observers/detection.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
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

// Whatever test it is, and only after as many samples as a detection takes.
TEST(DetectionTest, AShareAboveOneDetects) {
  ModelSet models = *SharedPlant();
  models.channels[1].windows = {{50, -0.8 * tests::kNoise, 0.8 * tests::kNoise,
                                 std::log(1.5 * tests::kNoise)}};
  int beyond = 0;
  for (const double fault : {0.0, 0.02, 0.05, 0.2, 1.0}) {
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    Noise noise(8);
    for (std::uint64_t k = 0; k < 600; ++k) {
      Sample sample = PlantSample(k);
      noise.Add(sample);
      if (k >= 300) {
        AddF6(sample, fault * tests::kNoise);
      }
      const bool was_open = engine.episode_open();
      const Verdict& verdict = engine.Step(sample);
      if (!was_open) {
        EXPECT_EQ(verdict.share > 1.0, verdict.detected) << k;
        beyond += verdict.detected ? 1 : 0;
      }
      EXPECT_GE(verdict.share, 0.0);
    }
  }
  EXPECT_GE(beyond, 3);
}

TEST(DetectionTest, AShareIsHeldForAsLongAsADetectionTakes) {
  ModelSet models = *SharedPlant();
  models.decision.detection_samples = 3;
  const double limit = models.channels[1].upper_threshold;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  std::vector<double> shares;
  for (std::uint64_t k = 0; k < 210; ++k) {
    Sample sample = PlantSample(k);
    sample.values[Index(Signal::kF)] += k < 200 ? 0.0 : 0.8 * limit;
    shares.push_back(engine.Step(sample).share);
  }
  EXPECT_LT(shares[199], 0.1);
  EXPECT_LT(shares[201], 0.1);
  EXPECT_NEAR(shares[202], 0.8, 0.05);
  EXPECT_NEAR(shares[209], 0.8, 0.05);
}

// One limit now and the other one next is no run beyond either.
TEST(DetectionTest, ASharePassesOneLimitAllTheTime) {
  ModelSet models = *SharedPlant();
  models.decision.detection_samples = 3;
  const double limit = models.channels[1].upper_threshold;
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  for (std::uint64_t k = 0; k < 260; ++k) {
    Sample sample = PlantSample(k);
    sample.values[Index(Signal::kF)] +=
        k < 200 ? 0.0 : (k % 2 == 0 ? 0.8 : -0.8) * limit;
    EXPECT_LT(engine.Step(sample).share, 0.5) << k;
  }
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

std::shared_ptr<const ModelSet> DriftingPlant() {
  ModelSet models = *SharedPlant();
  models.channels[1].lower_threshold = -100.0;
  models.channels[1].upper_threshold = 100.0;
  models.channels[1].windows = {
      {100, -kLimit, kLimit, std::log(1.5 * tests::kNoise)}};
  return std::make_shared<const ModelSet>(models);
}

// Hour of the first alarm while F is raised by `shift` limits and its noise
// grows by `growth` each hour; nothing if there is none in 24 h.
std::optional<double> AlarmAfter(double shift, double growth) {
  ValveEngine engine(DriftingPlant());
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

// A limit is reached in 12 h, and so is one on the noise in 10 h.
TEST(DetectionTest, SlowChangesAreFoundAsAnyOther) {
  EXPECT_EQ(AlarmAfter(0.0, 0.0), std::nullopt);
  const auto shifted = AlarmAfter(1.0 / 12.0, 0.0);
  ASSERT_TRUE(shifted.has_value());
  EXPECT_LT(*shifted, 12.0);
  const auto noisy = AlarmAfter(0.0, 1.0 / 20.0);
  ASSERT_TRUE(noisy.has_value());
  EXPECT_LT(*noisy, 11.0);
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
