#include <gtest/gtest.h>

#include "trainer/model_set_description.h"

namespace fdi::trainer {
namespace {

Sample At(double cv, double p1, double p2, double t1, double f) {
  Sample sample;
  sample.Set(Signal::kCv, cv);
  sample.Set(Signal::kP1, p1);
  sample.Set(Signal::kP2, p2);
  sample.Set(Signal::kT1, t1);
  sample.Set(Signal::kF, f);
  return sample;
}

std::vector<Condition> Conditions() {
  Condition normal;
  normal.training = {{"a",
                      {At(50.0, 3500.0, 2600.0, 100.0, 20.0),
                       At(58.0, 3600.0, 2650.0, 101.0, 15.0)}}};
  normal.validation = {{"a", {At(55.0, 3400.0, 2500.0, 100.0, 25.0)}}};
  Condition fault;
  fault.fault = 7;
  fault.training = {{"b", {At(80.0, 100.0, 2600.0, 300.0, 90.0)}}};
  return {normal, fault};
}

TEST(TrainedRegionTest, CommandsOfAllConditionsInputsOfNormalOperation) {
  const ValidityRegion region = TrainedRegion(Conditions());
  // 50..80 and 5 % on each side; steps of 8, twice.
  EXPECT_DOUBLE_EQ(region.cv.minimum, 45.0);
  EXPECT_DOUBLE_EQ(region.cv.maximum, 85.0);
  EXPECT_DOUBLE_EQ(region.cv_step, 16.0);
  // 900..950 and 5 % of 950; 3400..3600 and 180, more than half the range.
  EXPECT_DOUBLE_EQ(region.dp.minimum, 900.0 - 47.5);
  EXPECT_DOUBLE_EQ(region.dp.maximum, 950.0 + 47.5);
  EXPECT_DOUBLE_EQ(region.p1.minimum, 3400.0 - 180.0);
  EXPECT_DOUBLE_EQ(region.t1.minimum, 90.0);
  EXPECT_DOUBLE_EQ(region.t1.maximum, 111.0);
  EXPECT_DOUBLE_EQ(region.flow_cutoff, 0.5);
}

// The record went from 50 to 60 %, and for 30 samples up to 90 %.
TEST(TrainedRegionTest, EndsWhereSamplesAre) {
  std::vector<Condition> conditions = Conditions();
  conditions.resize(1);
  std::vector<Sample>& samples = conditions[0].training[0].samples;
  samples.assign(3000, At(50.0, 3500.0, 2600.0, 100.0, 20.0));
  for (std::size_t k = 0; k < 60; ++k) {
    samples[20 * k].Set(Signal::kCv,
                        k < 30 ? 60.0 : 31.0 + static_cast<double>(k));
  }
  EXPECT_DOUBLE_EQ(TrainedRegion(conditions).cv.maximum, 65.0);
  // Once more is seen there, that is part of it.
  samples[1].Set(Signal::kCv, 90.0);
  EXPECT_DOUBLE_EQ(TrainedRegion(conditions).cv.maximum, 66.0);
}

TEST(StuckLimitsTest, TenTimesTheLongestRunAndAMinute) {
  Condition normal;
  normal.training = {{"a", {}}};
  for (const double t1 : {100.0, 100.0, 100.0, 101.0, 100.0}) {
    normal.training[0].samples.push_back(
        At(50.0, 3500.0 + t1, 2600.0, t1, 1.0));
  }
  normal.validation = {{"a", {normal.training[0].samples.back()}}};
  normal.validation[0].samples[0].Set(Signal::kP2, 2500.0);
  const StuckLimits limits = FitStuckLimits(normal);
  EXPECT_EQ(limits.t1, 90);
  EXPECT_EQ(limits.p1, 90);
  EXPECT_EQ(limits.p2, 110);
  normal.training[0].samples[0].present = MaskOf(Signal::kCv);
  EXPECT_EQ(FitStuckLimits(normal).t1, 0);
}

TEST(TrainedRegionTest, SignalsThatAreLackingHaveNoBounds) {
  std::vector<Condition> conditions = Conditions();
  for (Condition& condition : conditions) {
    for (Stretch& stretch : condition.training) {
      for (Sample& sample : stretch.samples) {
        sample.present = MaskOf(Signal::kCv);
      }
    }
  }
  const ValidityRegion region = TrainedRegion(conditions);
  EXPECT_EQ(region.dp.minimum, kUnbounded.minimum);
  EXPECT_EQ(region.t1.maximum, kUnbounded.maximum);
  EXPECT_EQ(region.flow_cutoff, 0.0);
  EXPECT_DOUBLE_EQ(region.cv.maximum, 85.0);
}

}  // namespace
}  // namespace fdi::trainer
