#include "diagnosis/strength_tracker.h"

#include <gtest/gtest.h>

#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using testing::AddF3;
using testing::AddF6;
using testing::LinearPlant;
using testing::Noise;
using testing::PlantSample;

constexpr int kF3First = 3;  // observers of LinearPlant()
constexpr int kF6First = 5;

class StrengthTrackerTest : public ::testing::Test {
 protected:
  void Begin(ObserverBank& bank) { bank.Initialise(PlantSample(0)); }
};

TEST_F(StrengthTrackerTest, FollowsADevelopingFaultBetweenItsObservers) {
  const ModelSet models = LinearPlant();
  ObserverBank bank(models);
  Begin(bank);
  StrengthTracker tracker(models, {kF6First, kF6First + 1});
  tracker.Restart();
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
    StrengthTracker f3(models, {kF3First, kF3First + 1});
    StrengthTracker f6(models, {kF6First, kF6First + 1});
    f3.Restart();
    f6.Restart();
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

TEST_F(StrengthTrackerTest, StaysAtAnObserverWhereInterpolationFails) {
  ModelSet models = LinearPlant();
  for (int i = kF6First; i < kF6First + 2; ++i) {
    for (ChannelObserver& channel :
         models.observers[static_cast<std::size_t>(i)].channels) {
      channel.interpolation_error = 1.0;
    }
  }
  ObserverBank bank(models);
  Begin(bank);
  StrengthTracker tracker(models, {kF6First, kF6First + 1});
  tracker.Restart();
  for (std::uint64_t k = 0; k < 100; ++k) {
    Sample sample = PlantSample(k);
    AddF6(sample, 0.7);
    bank.Step(sample);
    tracker.Step(bank);
  }
  EXPECT_EQ(tracker.factor(), 0.0);  // 4 units from the nearer observer
}

TEST_F(StrengthTrackerTest, LoneObserverReachesAQuarterFurther) {
  const ModelSet models = LinearPlant();
  ObserverBank bank(models);
  Begin(bank);
  StrengthTracker tracker(models, {kF6First});  // strength 0.5 alone
  tracker.Restart();
  for (std::uint64_t k = 0; k < 100; ++k) {
    Sample sample = PlantSample(k);
    AddF6(sample, 1.0);
    bank.Step(sample);
    tracker.Step(bank);
  }
  EXPECT_NEAR(tracker.strength(), 0.625, 1e-9);
}

}  // namespace
}  // namespace fdi
