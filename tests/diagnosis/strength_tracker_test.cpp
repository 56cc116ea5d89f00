#include "diagnosis/decision/strength_tracker.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/fault_bank.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::AddF3;
using tests::AddF6;
using tests::LinearPlant;
using tests::Noise;
using tests::PlantSample;

constexpr std::size_t kF3First = 3;  // observers of LinearPlant()
constexpr std::size_t kF6First = 5;

// Acts as FaultBank does for one fault.
class Explanation {
 public:
  Explanation(const ModelSet& models, const std::vector<std::size_t>& observers)
      : plan_(std::make_shared<const FaultPlan>(
            std::make_shared<const ObserverPlan>(models))),
        path_(MakeStrengthPath(plan_->observers(), observers)),
        trained_(plan_),
        tracker_(*plan_, path_) {
    tracker_.Restart();
  }

  void Step(const ObserverBank& bank) {
    trained_.Gather(bank);
    tracker_.Step(bank);
  }
  double strength() const { return tracker_.strength(trained_); }
  double evidence() const { return tracker_.evidence(trained_); }

 private:
  std::shared_ptr<const FaultPlan> plan_;
  StrengthPath path_;
  ObserverEvidence trained_;
  StrengthTracker tracker_;
};

class StrengthTrackerTest : public ::testing::Test {
 protected:
  void Begin(ObserverBank& bank) { bank.Initialise(PlantSample(0)); }
};

TEST_F(StrengthTrackerTest, FollowsADevelopingFaultBetweenItsObservers) {
  const ModelSet models = LinearPlant();
  ObserverBank bank(models);
  Begin(bank);
  Explanation tracker(models, {kF6First, kF6First + 1});
  Noise noise(1);
  double worst = 0.0;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const double s = 0.3 + 0.0006 * static_cast<double>(k);
    Sample sample = PlantSample(k);
    noise.Add(sample);
    AddF6(sample, s);
    bank.Step(sample);
    tracker.Step(bank);
    if (k >= 100) {
      worst = std::max(worst, std::abs(tracker.strength() - s));
    }
  }
  EXPECT_LT(worst, 0.03);  // one deviation of the noise is worth 0.025
}

TEST_F(StrengthTrackerTest, EvidenceTellsSlopeFromOffsetOnlyInMotion) {
  const ModelSet models = LinearPlant();
  for (const double swing : {0.0, 20.0}) {
    ObserverBank bank(models);
    bank.Initialise(PlantSample(0, swing));
    Explanation f3(models, {kF3First, kF3First + 1});
    Explanation f6(models, {kF6First, kF6First + 1});
    Noise noise(2);
    for (std::uint64_t k = 0; k < 200; ++k) {
      Sample sample = PlantSample(k, swing);
      noise.Add(sample);
      AddF3(sample, 0.6);
      bank.Step(sample);
      f3.Step(bank);
      f6.Step(bank);
    }
    const double difference = f3.evidence() - f6.evidence();
    if (swing == 0.0) {
      EXPECT_LT(std::abs(difference), 1.0);
    } else {
      EXPECT_GT(difference, 30.0);
    }
  }
}

// Between the observers the fault is explained either way, but worth less where
// the trainer found that interpolation errs.
TEST_F(StrengthTrackerTest, DoubtfulInterpolationGathersLessEvidence) {
  std::vector<double> evidence;
  for (const double error : {0.02, 1.0}) {
    ModelSet models = LinearPlant();
    for (std::size_t i = kF6First; i < kF6First + 2; ++i) {
      for (ChannelObserver& channel : models.observers[i].channels) {
        channel.interpolation_error = error;
      }
    }
    ObserverBank bank(models);
    Begin(bank);
    Explanation tracker(models, {kF6First, kF6First + 1});
    for (std::uint64_t k = 0; k < 100; ++k) {
      Sample sample = PlantSample(k);
      AddF6(sample, 0.7);
      bank.Step(sample);
      tracker.Step(bank);
    }
    evidence.push_back(tracker.evidence());
  }
  EXPECT_GT(evidence[0], evidence[1] + 10.0);
}

// However interpolation errs, a strength that was trained is met.
TEST_F(StrengthTrackerTest, TrainedStrengthHasTheEvidenceOfItsObserver) {
  ModelSet models = LinearPlant();
  for (ChannelObserver& channel : models.observers[kF6First].channels) {
    channel.interpolation_error = 1.0;
  }
  ObserverBank bank(models);
  Begin(bank);
  Explanation f6(models, {kF6First, kF6First + 1});
  Explanation alone(models, {kF6First + 1});
  for (std::uint64_t k = 0; k < 100; ++k) {
    Sample sample = PlantSample(k);
    AddF6(sample, 1.0);
    bank.Step(sample);
    f6.Step(bank);
    alone.Step(bank);
  }
  EXPECT_NEAR(f6.strength(), 1.0, 0.01);
  EXPECT_GE(f6.evidence(), alone.evidence() - 1.0);
}

TEST_F(StrengthTrackerTest, LoneObserverReachesAQuarterFurther) {
  const ModelSet models = LinearPlant();
  ObserverBank bank(models);
  Begin(bank);
  Explanation tracker(models, {kF6First});  // strength 0.5 alone
  for (std::uint64_t k = 0; k < 100; ++k) {
    Sample sample = PlantSample(k);
    AddF6(sample, 0.65);
    bank.Step(sample);
    tracker.Step(bank);
  }
  EXPECT_NEAR(tracker.strength(), 0.625, 1e-9);
}

// The plant with a flow transmitter that reads 60 at most.
ModelSet SaturatingPlant() {
  ModelSet models = LinearPlant();
  for (Observer& observer : models.observers) {
    observer.channels[1].model.saturation = 60.0;
  }
  return models;
}

Sample SaturatingSample(std::uint64_t k, double cv, double f3, Noise& noise) {
  Sample sample = PlantSample(k);
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kX, cv);
  sample.Set(Signal::kF, 100.0 - cv);
  AddF3(sample, f3);
  noise.Add(sample);
  sample.Set(Signal::kF, std::min(sample[Signal::kF], 60.0));
  return sample;
}

// F tells f3 from f6 for 200 samples; then it is at its limit for three times
// the memory of evidence.
TEST_F(StrengthTrackerTest,
       WhatWasEliminatedStaysSoWhileTheReadingIsSaturated) {
  const ModelSet models = SaturatingPlant();
  ObserverBank bank(models);
  bank.Initialise(PlantSample(0));
  Explanation f3(models, {kF3First, kF3First + 1});
  Explanation f6(models, {kF6First, kF6First + 1});
  Noise noise(4);
  const auto step = [&](std::uint64_t k, double cv) {
    bank.Step(SaturatingSample(k, cv, 0.6, noise));
    f3.Step(bank);
    f6.Step(bank);
  };
  std::uint64_t k = 0;
  for (; k < 200; ++k) {
    step(k, 75.0 + 15.0 * std::sin(0.2 * static_cast<double>(k)));
  }
  const double before = f3.evidence() - f6.evidence();
  ASSERT_GT(before, 20.0);
  for (; k < 800; ++k) {
    step(k, 10.0);
    ASSERT_TRUE(bank.saturated(1));
  }
  EXPECT_NEAR(f3.evidence() - f6.evidence(), before, 0.1 * before);
  // Once it reads again, evidence fades as ever.
  for (; k < 2000; ++k) {
    step(k, 50.0 + 20.0 * 1.01);
  }
  EXPECT_LT(std::abs(f3.evidence() - f6.evidence()), 0.5 * before);
}

// F is predicted from X, by one observer of f1 wrongly, as where the rod stands
// at the stop of a weaker fault.
ModelSet PlantWithFlowFromPosition(std::size_t wrong) {
  ModelSet models = LinearPlant();
  models.faults = {1};
  models.observers.resize(3);
  for (Observer& observer : models.observers) {
    observer.channels[1].model.regressors = {{Signal::kX, 0}};
    for (ChannelObserver& channel : observer.channels) {
      channel.fit = {-1.5, 1.5, 4.0};
      channel.interpolation_error = 1.0;
    }
  }
  models.observers[wrong].channels[1].model.rules[0].intercept += 3.0;
  return models;
}

bool Fits(double strength, std::size_t wrong) {
  const ModelSet models = PlantWithFlowFromPosition(wrong);
  ObserverBank bank(models);
  bank.Initialise(PlantSample(0));
  FaultBank faults(models);
  faults.Restart();
  Noise noise(6);
  for (std::uint64_t k = 0; k < 200; ++k) {
    Sample sample = PlantSample(k);
    sample.values[Index(Signal::kX)] -= 20.0 * strength;
    sample.values[Index(Signal::kF)] += 20.0 * strength;
    noise.Add(sample);
    bank.Step(sample);
    faults.PushInputs(sample);
    faults.Update(bank);
  }
  return faults.misfits() == 0;
}

// Below the least trained strength, normal operation is the neighbour and would
// excuse any fault.
TEST(FaultBankTest, AnErrorOfInterpolationExcusesNoEffectThatIsNotThere) {
  EXPECT_FALSE(Fits(0.25, 1));
  EXPECT_TRUE(Fits(0.25, 2));
}

// f3 at .75, midway between its strengths, where the flow is off by a few per
// cent of the effect: enough for f6 to gather more evidence in the long run,
// and no reason to drop f3. At the trained strength 1, nothing is allowed for.
TEST(FaultBankTest, ErrorsOfInterpolationDoNotAddUpToAVerdict) {
  ModelSet models = LinearPlant();
  const auto f3 = static_cast<std::size_t>(FaultIndex(models, 3));
  const auto f6 = static_cast<std::size_t>(FaultIndex(models, 6));
  // Which of the two have a factor of T.
  const auto named = [&](double allowance, double strength) {
    models.decision.interpolation_allowance = allowance;
    ObserverBank bank(models);
    FaultBank faults(models);
    Verdict verdict;
    Noise noise(7);
    constexpr double kSwing = 4.0;
    bank.Initialise(PlantSample(0, kSwing));
    faults.Restart();
    for (std::uint64_t k = 1; k < 400; ++k) {
      Sample sample = PlantSample(k, kSwing);
      noise.Add(sample);
      AddF3(sample, strength);
      if (strength < 1.0) {
        // The slope is that of f6 but for a quarter.
        sample.values[Index(Signal::kF)] -=
            0.75 * 0.4 * strength * (sample[Signal::kCv] - 50.0);
      }
      bank.Step(sample);
      faults.Score(bank, verdict);
      faults.Update(bank);
      faults.ApplyEvidence(verdict);
    }
    const double threshold = models.decision.isolation_threshold;
    return std::pair{verdict.fault_factors[f3] >= threshold,
                     verdict.fault_factors[f6] >= threshold};
  };

  EXPECT_EQ(named(0.0, 0.75), std::pair(false, true));
  EXPECT_EQ(named(0.06, 0.75), std::pair(true, true));
  EXPECT_EQ(named(0.06, 1.0), std::pair(true, false));
}

// The valve is half closed, and the flow reads the limit all the same: any
// reading below would have refuted f6, so it is named.
TEST(FaultBankTest, ReadingAtTheLimitSpeaksForWhatPredictsIt) {
  const ModelSet models = SaturatingPlant();
  const auto f6 = static_cast<std::size_t>(FaultIndex(models, 6));
  ObserverBank bank(models);
  FaultBank faults(models);
  Verdict verdict;
  Noise noise(5);
  bank.Initialise(SaturatingSample(0, 44.0, 0.0, noise));
  faults.Restart();
  for (std::uint64_t k = 1; k < 50; ++k) {
    Sample sample = SaturatingSample(k, 44.0, 0.0, noise);
    sample.Set(Signal::kF, 60.0);
    bank.Step(sample);
    faults.Score(bank, verdict);
    faults.Update(bank);
    faults.ApplyEvidence(verdict);
  }
  EXPECT_EQ(verdict.fault_factors[f6], 1.0);
  EXPECT_LT(verdict.normal_factor, 0.1);
}

}  // namespace
}  // namespace fdi
