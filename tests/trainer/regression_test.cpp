#include "trainer/regression.h"

#include <gtest/gtest.h>

namespace fdi::trainer {
namespace {

Stretch Ramp(int count, double from) {
  Stretch stretch{"r", {}};
  for (int k = 0; k < count; ++k) {
    Sample sample;
    sample.Set(Signal::kCv, from + k);
    sample.Set(Signal::kX, 10.0 * (from + k));
    stretch.samples.push_back(sample);
  }
  return stretch;
}

TEST(RegressionTest, RowsReachBackWithinTheirStretchOnly) {
  const std::vector<Stretch> stretches{Ramp(5, 0.0), Ramp(4, 100.0)};
  const RegressionData data = BuildRegression(
      stretches, {{Signal::kCv, 0}, {Signal::kCv, 2}}, Signal::kX);
  ASSERT_EQ(data.y.size(), 3 + 2);
  for (Eigen::Index row = 0; row < data.y.size(); ++row) {
    EXPECT_EQ(data.x(row, 0) - data.x(row, 1), 2.0);
    EXPECT_EQ(data.y(row), 10.0 * data.x(row, 0));
  }
  EXPECT_EQ(data.x(3, 1), 100.0);
}

// x̂(k) = 0.5 x̂(k−1), whatever is measured.
TsModel Decay() {
  TsModel model;
  model.output = Signal::kX;
  model.regressors = {{Signal::kX, 1}};
  model.output_min = -1000.0;
  model.output_max = 1000.0;
  TsRule rule;
  rule.antecedents = {{0.0, 0.0, 1e6, 1e6}};
  rule.slopes = {0.5};
  model.rules = {rule};
  return model;
}

TEST(RegressionTest, ParallelModelRunsOnItsOwnPast) {
  Stretch stretch = Ramp(6, 0.0);
  for (Sample& sample : stretch.samples) {
    sample.Set(Signal::kX, 0.0);
  }
  stretch.samples[0].Set(Signal::kX, 64.0);
  // x̂ = 32, 16, 8, ... against a measured 0.
  const std::vector<double> residuals = RunResiduals(Decay(), stretch, 2);
  ASSERT_EQ(residuals.size(), 4U);
  EXPECT_DOUBLE_EQ(residuals[0], -8.0);
  EXPECT_DOUBLE_EQ(residuals[3], -1.0);
}

TEST(RegressionTest, PastOutputReplacesTheMeasuredStart) {
  const std::vector<double> residuals =
      RunResiduals(Decay(), Ramp(2, 0.0), 1, 128.0);
  ASSERT_EQ(residuals.size(), 1U);
  EXPECT_DOUBLE_EQ(residuals[0], 10.0 - 32.0);
}

TEST(RegressionTest, StaticModelLosesOnlyItsLags) {
  TsModel model = Decay();
  model.regressors = {{Signal::kCv, 1}};
  EXPECT_FALSE(IsFreeRunning(model));
  EXPECT_EQ(RunResiduals(model, Ramp(50, 0.0), 30).size(), 49U);
  EXPECT_TRUE(IsFreeRunning(Decay()));
  EXPECT_EQ(RunResiduals(Decay(), Ramp(50, 0.0), 30).size(), 20U);
}

}  // namespace
}  // namespace fdi::trainer
