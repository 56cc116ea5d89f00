#include "trainer/observer_adaptation.h"

#include <cmath>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "base/error.h"
#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

constexpr double kNoise = 0.1;

// F = 2 X, X in 0..10, as one rule.
TsModel Normal() {
  TsModel model;
  model.output = Signal::kF;
  model.regressors = {{Signal::kX, 0}};
  model.regressor_min = {0.0};
  model.regressor_max = {10.0};
  model.output_min = -10.0;
  model.output_max = 60.0;
  TsRule rule;
  rule.antecedents = {{5.0, 5.0, 1e6, 1e6}};
  rule.slopes = {2.0};
  rule.data_share = 1.0;
  model.rules = {rule};
  return model;
}

// X follows a sine; F = 2 X (1 + gain s_k), read up to `limit`.
Condition Fault(double gain, double from, double to, double limit = 1e9) {
  Condition condition;
  condition.fault = 19;
  condition.strength = 0.5 * (from + to);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, kNoise);
  for (auto* stretches : {&condition.training, &condition.validation}) {
    Stretch stretch{"r", {}};
    for (int k = 0; k < 300; ++k) {
      const double s = from + (to - from) * k / 300.0;
      const double x = 5.0 + 5.0 * std::sin(0.1 * k);
      Sample sample;
      sample.Set(Signal::kX, x);
      sample.Set(Signal::kF,
                 std::min(2.0 * x * (1.0 + gain * s) + noise(random), limit));
      stretch.samples.push_back(sample);
      stretch.strengths.push_back(s);
    }
    stretches->push_back(stretch);
  }
  return condition;
}

double At(const TsModel& model, double x) {
  return Evaluate(model, &x);
}

TEST(AdaptModelTest, FindsAnotherGain) {
  const AdaptedModel adapted = AdaptModel(Normal(), Fault(0.5, 1.0, 1.0));
  EXPECT_NEAR(At(adapted.model, 8.0), 24.0, 0.1);
  EXPECT_NEAR(At(adapted.model, 2.0), 6.0, 0.1);
  EXPECT_EQ(adapted.residuals.size(), 600U);
  EXPECT_EQ(adapted.outputs.size(), 600U);
}

TEST(AdaptModelTest, KeepsTheNormalModelWhereItExplainsTheFault) {
  const AdaptedModel adapted = AdaptModel(Normal(), Fault(0.0, 1.0, 1.0));
  EXPECT_EQ(adapted.model.rules[0].slopes[0], 2.0);
  EXPECT_EQ(adapted.model.rules[0].intercept, 0.0);
}

// A ramp of strength 0.4 to 1 is met at its mean; its spread is no residual.
TEST(AdaptModelTest, DevelopingFaultIsFittedAtTheStrengthOfTheCondition) {
  const AdaptedModel adapted = AdaptModel(Normal(), Fault(1.0, 0.4, 1.0));
  EXPECT_NEAR(At(adapted.model, 5.0), 10.0 * 1.7, 0.15);
  double squares = 0.0;
  for (const double r : adapted.residuals) {
    squares += r * r;
  }
  EXPECT_LT(std::sqrt(squares / 600.0), 1.5 * kNoise);
}

// F = 3 X is read up to 15, which is reached at X = 5.
TEST(AdaptModelTest, ReadingsAtTheLimitDoNotBendTheModel) {
  TsModel normal = Normal();
  normal.saturation = 14.9;
  const AdaptedModel adapted = AdaptModel(normal, Fault(0.5, 1.0, 1.0, 15.0));
  EXPECT_NEAR(At(adapted.model, 4.0), 12.0, 0.2);
  EXPECT_GT(At(adapted.model, 8.0), 20.0);
  EXPECT_LT(adapted.residuals.size(), 400U);
}

TEST(AdaptModelTest, ModelOfItsOwnPastIsRefused) {
  TsModel model = Normal();
  model.regressors = {{Signal::kF, 1}};
  EXPECT_THROW(AdaptModel(model, Fault(0.5, 1.0, 1.0)), std::invalid_argument);
}

TEST(AdaptModelTest, ConditionOfFewSamplesIsNamed) {
  Condition condition = Fault(0.5, 1.0, 1.0);
  condition.training[0].samples.resize(5);
  condition.training[0].strengths.resize(5);
  condition.validation[0].samples.resize(5);
  condition.validation[0].strengths.resize(5);
  try {
    AdaptModel(Normal(), condition);
    FAIL() << "DataError expected";
  } catch (const DataError& error) {
    EXPECT_NE(std::string(error.what()).find("f19"), std::string::npos);
  }
}

// One preparation for all gives the same bits as a problem of its own.
TEST(AdaptationTest, ServesConditionsThatDifferInTheirOutputsAlone) {
  const Adaptation prepared(Normal(), Fault(0.0, 0.5, 0.5));
  const Condition fault = Fault(0.6, 0.5, 0.5);
  ASSERT_TRUE(prepared.Serves(fault));
  const AdaptedModel once = prepared.Fit(fault);
  const AdaptedModel own = AdaptModel(Normal(), fault);
  EXPECT_EQ(once.model.rules[0].slopes, own.model.rules[0].slopes);
  EXPECT_EQ(once.residuals, own.residuals);
  Condition elsewhere = fault;
  elsewhere.training[0].samples[7].Set(Signal::kX, 1.0);
  EXPECT_FALSE(prepared.Serves(elsewhere));
  EXPECT_FALSE(prepared.Serves(Fault(0.6, 0.2, 0.8)));
}

}  // namespace
}  // namespace fdi::trainer
