#include "diagnosis/model/ts_model.h"

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// y = 1 + x₁ below, y = 10 − 2 x₂ above, blended over x₁.
TsModel TwoRules() {
  TsModel model;
  model.output = Signal::kF;
  model.parallel = false;
  model.regressors = {{Signal::kX, 0}, {Signal::kF, 3}};
  model.regressor_min = {0.0, 0.0};
  model.regressor_max = {100.0, 100.0};
  model.output_min = -1000.0;
  model.output_max = 1000.0;
  const FuzzySet anything{0.0, 0.0, kInfinity, kInfinity};
  model.rules = {
      {{{10.0, 20.0, kInfinity, 5.0}, anything}, {1.0, 0.0}, 1.0, .5},
      {{{40.0, 50.0, 8.0, kInfinity}, anything}, {0.0, -2.0}, 10., .5}};
  return model;
}

// Equations (7) and (8) written out with the library's exp.
double Reference(const TsModel& model, const std::vector<double>& x) {
  double numerator = 0.0;
  double denominator = 0.0;
  for (const TsRule& rule : model.rules) {
    double beta = 1.0;
    double y = rule.intercept;
    for (std::size_t j = 0; j < x.size(); ++j) {
      const FuzzySet& set = rule.antecedents[j];
      const double left = std::max(0.0, set.left_center - x[j]);
      const double right = std::max(0.0, x[j] - set.right_center);
      beta *= std::exp(-0.5 * std::pow(left / set.left_width, 2)) *
              std::exp(-0.5 * std::pow(right / set.right_width, 2));
      y += rule.slopes[j] * x[j];
    }
    numerator += beta * y;
    denominator += beta;
  }
  return numerator / denominator;
}

TEST(TsModelTest, OneRuleIsALinearModelWhereverXIs) {
  TsModel model = TwoRules();
  model.rules.resize(1);
  const double x[] = {150.0, 3.0};

  EXPECT_DOUBLE_EQ(Evaluate(model, x), 151.0);
}

TEST(TsModelTest, PredictionIsTheWeightedMeanOfTheRules) {
  const TsModel model = TwoRules();
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> value(0.0, 60.0);
  for (int i = 0; i < 1000; ++i) {
    const std::vector<double> x = {value(generator), value(generator)};

    const double expected = Reference(model, x);
    EXPECT_NEAR(Evaluate(model, x.data()), expected,
                1e-13 * (1.0 + std::abs(expected)));
  }
}

TEST(TsModelTest, HalfwayBetweenEqualSetsTheRulesCountTheSame) {
  TsModel model = TwoRules();
  model.rules[1].antecedents[0].left_width = 5.0;
  const double x[] = {30.0, 2.0};

  EXPECT_DOUBLE_EQ(Evaluate(model, x), (31.0 + 6.0) / 2.0);
}

TEST(TsModelTest, FarFromAllRulesTheNearestOneAnswers) {
  TsModel model = TwoRules();
  model.rules[0].antecedents[0].left_width = 100.0;
  model.rules[1].antecedents[0].right_width = 1.0;
  const double near_first[] = {10.0 - 1e3, 5.0};
  const double near_second[] = {50.0 + 1e200, 5.0};

  EXPECT_DOUBLE_EQ(Evaluate(model, near_first), 1.0 + 10.0 - 1e3);
  // So far out that both exponents overflow: still a number.
  EXPECT_TRUE(std::isfinite(Evaluate(model, near_second)));
}

// Covariance [4 3; 3 9] about (20, 30): at (22, 33) a squared distance of
// (4·9 − 2·3·6 + 9·4)/27 = 4/3, at (22, 27) of 108/27 = 4.
TEST(TsModelTest, ARuleWithACenterFiresByTheDistanceInTheProductSpace) {
  TsModel model = TwoRules();
  const FuzzySet anything{0.0, 0.0, kInfinity, kInfinity};
  for (TsRule& rule : model.rules) {
    rule.antecedents = {anything, anything};
  }
  const double root = std::sqrt(6.75);
  model.rules[0].center = {20.0, 30.0};
  model.rules[0].metric = {0.5, -0.75 / root, 1.0 / root};
  for (const auto& [x2, squared] : {std::pair{33.0, 4.0 / 3.0}, {27.0, 4.0}}) {
    const double x[] = {22.0, x2};
    const double beta = std::exp(-0.5 * squared);
    EXPECT_NEAR(Evaluate(model, x),
                (beta * 23.0 + 10.0 - 2.0 * x2) / (beta + 1.0), 1e-12)
        << x2;
  }
}

TEST(TsModelTest, ACenterMayLeaveTheLastRegressorsOut) {
  TsModel model = TwoRules();
  const FuzzySet anything{0.0, 0.0, kInfinity, kInfinity};
  for (TsRule& rule : model.rules) {
    rule.antecedents = {anything, anything};
  }
  model.rules[0].center = {20.0};
  model.rules[0].metric = {1.0};
  for (const double x2 : {33.0, 27.0}) {
    const double x[] = {22.0, x2};
    const double beta = std::exp(-0.5 * 4.0);
    EXPECT_NEAR(Evaluate(model, x),
                (beta * 23.0 + 10.0 - 2.0 * x2) / (beta + 1.0), 1e-12);
  }
  const double beyond_numbers[] = {1e300, 0.0};
  EXPECT_TRUE(std::isfinite(Evaluate(model, beyond_numbers)));
}

TEST(TsModelTest, AntecedentsAreSharedOnlyWithTheSameCenterAndMetric) {
  TsModel model = TwoRules();
  model.rules[0].center = {20.0};
  model.rules[0].metric = {1.0};
  TsModel other = model;
  other.rules[0].slopes[0] = 9.0;
  EXPECT_TRUE(SharesAntecedents(model, other));
  other.rules[0].center[0] = 20.5;
  EXPECT_FALSE(SharesAntecedents(model, other));
  other = model;
  other.rules[0].metric[0] = 1.5;
  EXPECT_FALSE(SharesAntecedents(model, other));
}

TEST(TsModelTest, PredictionStaysWithinTheLimitsOfTheOutput) {
  TsModel model = TwoRules();
  model.output_min = 12.0;
  model.output_max = 15.0;
  const double low[] = {5.0, 0.0};
  const double high[] = {20.0, 0.0};

  EXPECT_EQ(Evaluate(model, low), 12.0);
  EXPECT_EQ(Evaluate(model, high), 15.0);
}

TEST(TsModelTest, AParallelModelDoesNotReadItsOwnOutput) {
  TsModel model = TwoRules();
  EXPECT_EQ(RequiredSignals(model), MaskOf(Signal::kX) | MaskOf(Signal::kF));
  EXPECT_EQ(MaxLag(model), 3);

  model.parallel = true;
  EXPECT_EQ(RequiredSignals(model), MaskOf(Signal::kX));
}

TEST(TsModelTest, ASoundModelPassesValidation) {
  EXPECT_NO_THROW(Validate(TwoRules(), "set 'a'"));
}

struct Damage {
  const char* message;
  void (*apply)(TsModel&);
};

class TsModelDamageTest : public testing::TestWithParam<Damage> {};

TEST_P(TsModelDamageTest, IsRefusedWithPlaceAndReason) {
  TsModel model = TwoRules();
  GetParam().apply(model);
  try {
    Validate(model, "set 'a'");
    FAIL() << "accepted";
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("set 'a'"));
    EXPECT_THAT(error.what(), testing::HasSubstr(GetParam().message));
  }
}

const double kNan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    All, TsModelDamageTest,
    testing::Values(
        Damage{"0 rules", [](TsModel& m) { m.rules.clear(); }},
        Damage{"0 regressors", [](TsModel& m) { m.regressors.clear(); }},
        Damage{"regressor_max", [](TsModel& m) { m.regressor_max.pop_back(); }},
        Damage{"lag 17", [](TsModel& m) { m.regressors[1].lag = 17; }},
        Damage{"lag -1", [](TsModel& m) { m.regressors[0].lag = -1; }},
        Damage{"lag 0 on the output",
               [](TsModel& m) { m.regressors[1].lag = 0; }},
        Damage{"output_min above", [](TsModel& m) { m.output_min = 2000.0; }},
        Damage{"output_max is not a finite",
               [](TsModel& m) { m.output_max = kInfinity; }},
        Damage{"rule 2: slopes", [](TsModel& m) { m.rules[1].slopes = {1.0}; }},
        Damage{"rule 1: antecedents",
               [](TsModel& m) { m.rules[0].antecedents.pop_back(); }},
        Damage{"slope 2 is not",
               [](TsModel& m) { m.rules[0].slopes[1] = kNan; }},
        Damage{"intercept", [](TsModel& m) { m.rules[0].intercept = kNan; }},
        Damage{"data share", [](TsModel& m) { m.rules[0].data_share = 1.5; }},
        Damage{"left width",
               [](TsModel& m) { m.rules[1].antecedents[0].left_width = 0.0; }},
        Damage{
            "right width",
            [](TsModel& m) { m.rules[1].antecedents[0].right_width = kNan; }},
        Damage{"left center above",
               [](TsModel& m) { m.rules[1].antecedents[0].left_center = 60; }},
        Damage{"rule 1: center has 3",
               [](TsModel& m) {
                 m.rules[0].center = {1.0, 2.0, 3.0};
               }},
        Damage{"rule 2: metric has 2 entries, expected 3",
               [](TsModel& m) {
                 m.rules[1].center = {1.0, 2.0};
                 m.rules[1].metric = {1.0, 2.0};
               }},
        Damage{"center or metric is not",
               [](TsModel& m) {
                 m.rules[1].center = {1.0};
                 m.rules[1].metric = {kNan};
               }},
        Damage{"33 rules", [](TsModel& m) { m.rules.resize(33); }}));

}  // namespace
}  // namespace fdi
