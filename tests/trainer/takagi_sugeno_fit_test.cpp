#include "trainer/takagi_sugeno_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/trainer/sampled_function.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double MeanSquaredError(const std::vector<TsRule>& rules,
                        const RegressionData& data) {
  return (Predict(rules, data.x) - data.y).squaredNorm() /
         static_cast<double>(data.y.size());
}

double Rising(double a, double b) {
  return 2.0 * a - 0.01 * b + 5.0;
}

// Slope −1 for a < 0.2, slope 3 above.
double Kink(double a, double b) {
  return (a < 0.2 ? 0.2 - a : 3.0 * (a - 0.2)) + 1e-4 * b;
}

TakagiSugenoOptions Rules(int count) {
  TakagiSugenoOptions options;
  options.num_rules = count;
  return options;
}

TEST(TakagiSugenoFitTest, OneRuleIsTheLinearModelOfAllData) {
  const RegressionData data = Sampled(200, Rising);
  const std::vector<TsRule> rules = FitTakagiSugeno(data, Rules(1));

  ASSERT_EQ(rules.size(), 1U);
  EXPECT_NEAR(rules[0].slopes[0], 2.0, 1e-11);
  EXPECT_NEAR(rules[0].slopes[1], -0.01, 1e-13);
  EXPECT_NEAR(rules[0].intercept, 5.0, 1e-9);
  EXPECT_EQ(rules[0].data_share, 1.0);
  MatrixXd far(1, 2);
  far << 1e6, -1e6;
  EXPECT_NEAR(Predict(rules, far)(0), Rising(1e6, -1e6), 1e-4);
}

TEST(TakagiSugenoFitTest, EveryRuleOfALinearFunctionIsThatFunction) {
  for (const int c : {2, 3, 5}) {
    const auto rules = FitTakagiSugeno(Sampled(300, Rising), Rules(c));
    for (const TsRule& rule : rules) {
      EXPECT_NEAR(rule.slopes[0], 2.0, 1e-8);
      EXPECT_NEAR(rule.slopes[1], -0.01, 1e-10);
    }
  }
}

TEST(TakagiSugenoFitTest, TwoRulesFindTheSlopesOnBothSidesOfAKink) {
  const RegressionData data = Sampled(500, Kink);
  std::vector<TsRule> rules = FitTakagiSugeno(data, Rules(2));
  ASSERT_EQ(rules.size(), 2U);
  std::sort(rules.begin(), rules.end(), [](const TsRule& a, const TsRule& b) {
    return a.slopes[0] < b.slopes[0];
  });

  EXPECT_NEAR(rules[0].slopes[0], -1.0, 0.1);
  EXPECT_NEAR(rules[1].slopes[0], 3.0, 0.1);
  EXPECT_NEAR(rules[0].data_share, 0.6, 0.05);
  const double variance = (data.y.array() - data.y.mean()).square().mean();
  EXPECT_LT(MeanSquaredError(rules, data), 2e-3 * variance);
}

// Tests that hold for either kind of antecedents.
class AntecedentKindTest : public testing::TestWithParam<AntecedentKind> {
 protected:
  static TakagiSugenoOptions Rules(int count) {
    TakagiSugenoOptions options;
    options.num_rules = count;
    options.antecedent_kind = GetParam();
    return options;
  }
};

INSTANTIATE_TEST_SUITE_P(All, AntecedentKindTest,
                         testing::Values(AntecedentKind::kProjected,
                                         AntecedentKind::kProductSpace),
                         [](const auto& kind) {
                           return kind.param == AntecedentKind::kProjected
                                      ? "Projected"
                                      : "ProductSpace";
                         });

TEST_P(AntecedentKindTest, PredictAndEvaluateAgree) {
  const RegressionData data = Sampled(300, Hills);
  TsModel model;
  model.output_min = -1e9;
  model.output_max = 1e9;
  model.rules = FitTakagiSugeno(data, Rules(5));

  const VectorXd predicted = Predict(model.rules, data.x);
  for (Index k = 0; k < 300; ++k) {
    const VectorXd x = data.x.row(k);
    EXPECT_NEAR(Evaluate(model, x.data()), predicted(k), 1e-9);
  }
}

TEST_P(AntecedentKindTest, DegreesOfFulfilmentOfEachRowSumToOne) {
  RegressionData data = Sampled(300, Hills);
  const auto rules = FitTakagiSugeno(data, Rules(4));
  data.x *= 1000.0;  // Far outside what was trained on.
  const MatrixXd w = DegreesOfFulfilment(rules, data.x);

  EXPECT_LT((w.rowwise().sum().array() - 1.0).abs().maxCoeff(), 1e-14);
  double share = 0.0;
  for (const TsRule& rule : rules) {
    share += rule.data_share;
  }
  EXPECT_NEAR(share, 1.0, 1e-12);
}

TEST_P(AntecedentKindTest, GlobalEstimationHasTheLowerTrainingError) {
  const RegressionData data = Sampled(250, Hills);
  for (const int c : {2, 3, 5}) {
    TakagiSugenoOptions options = Rules(c);
    options.min_width_factor = 1.0;  // The same antecedents for both.
    const double local = MeanSquaredError(FitTakagiSugeno(data, options), data);
    options.consequents.method = ConsequentMethod::kGlobal;
    const double global =
        MeanSquaredError(FitTakagiSugeno(data, options), data);
    EXPECT_LE(global, local * (1.0 + 1e-9)) << c << " rules";
  }
}

TEST_P(AntecedentKindTest, NarrowingNeverRaisesTheTrainingError) {
  const RegressionData data = Sampled(300, Hills);
  TakagiSugenoOptions options = Rules(5);
  const auto narrowed = FitTakagiSugeno(data, options);
  options.min_width_factor = 1.0;
  const auto projected = FitTakagiSugeno(data, options);

  EXPECT_LT(MeanSquaredError(narrowed, data),
            MeanSquaredError(projected, data));
}

TEST_P(AntecedentKindTest, UnitsOfTheDataDoNotMatter) {
  const RegressionData data = Sampled(300, Hills);
  RegressionData scaled = data;
  scaled.x.col(0) = data.x.col(0).array() * 1e5 + 3.0;
  scaled.x.col(1) = data.x.col(1).array() * 1e-3;
  scaled.y = data.y.array() * 70.0 - 20.0;
  const VectorXd expected =
      Predict(FitTakagiSugeno(data, Rules(5)), data.x).array() * 70.0 - 20.0;

  const VectorXd found = Predict(FitTakagiSugeno(scaled, Rules(5)), scaled.x);
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 70.0 * 1e-7);
}

TEST_P(AntecedentKindTest, OrderOfTheRowsDoesNotMatter) {
  const RegressionData data = Sampled(300, Hills);
  std::vector<Index> order(300);
  std::iota(order.begin(), order.end(), Index{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  const RegressionData shuffled{data.x(order, Eigen::all), data.y(order)};

  const VectorXd a = Predict(FitTakagiSugeno(data, Rules(5)), data.x);
  const VectorXd b = Predict(FitTakagiSugeno(shuffled, Rules(5)), data.x);
  EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_P(AntecedentKindTest, SameSeedGivesTheSameBits) {
  const RegressionData data = Sampled(300, Hills);
  const auto a = FitTakagiSugeno(data, Rules(4));
  const auto b = FitTakagiSugeno(data, Rules(4));

  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].slopes, b[i].slopes);
    EXPECT_EQ(a[i].intercept, b[i].intercept);
    EXPECT_EQ(a[i].data_share, b[i].data_share);
    EXPECT_EQ(a[i].center, b[i].center);
    EXPECT_EQ(a[i].metric, b[i].metric);
  }
}

// The column is left out of clustering: the others are fitted as without it.
TEST_P(AntecedentKindTest, AConstantColumnIsDropped) {
  const RegressionData data = Sampled(300, Hills);
  RegressionData padded{MatrixXd(300, 3), data.y};
  padded.x << data.x.col(0), VectorXd::Constant(300, 43.0), data.x.col(1);
  const auto rules = FitTakagiSugeno(padded, Rules(4));

  for (const TsRule& rule : rules) {
    EXPECT_NEAR(rule.slopes[1], 0.0, 1e-12);
    EXPECT_TRUE(std::isinf(rule.antecedents[1].left_width));
    EXPECT_TRUE(std::isinf(rule.antecedents[1].right_width));
  }
  const VectorXd expected = Predict(FitTakagiSugeno(data, Rules(4)), data.x);
  EXPECT_LT((Predict(rules, padded.x) - expected).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(AntecedentKindTest, ConstantDataGiveOneConstantRule) {
  const RegressionData data{MatrixXd::Constant(50, 2, 3.0),
                            VectorXd::Constant(50, 12.5)};
  const auto rules = FitTakagiSugeno(data, Rules(3));

  ASSERT_EQ(rules.size(), 1U);
  EXPECT_NEAR(Predict(rules, data.x)(0), 12.5, 1e-12);
}

// One step from random memberships this soft leaves them all near 1/c.
TEST(TakagiSugenoFitTest, ATrivialPartitionGivesOneRule) {
  TakagiSugenoOptions options = Rules(3);
  options.clustering.fuzziness = 20.0;
  options.clustering.num_starts = 1;
  options.clustering.max_iterations = 1;

  EXPECT_EQ(FitTakagiSugeno(Sampled(300, Hills), options).size(), 1U);
}

// Slopes that change across a diagonal: sets on the axes blur it.
TEST(TakagiSugenoFitTest, TheProductSpaceKeepsAnObliqueBorder) {
  const RegressionData data = Sampled(500, [](double a, double b) {
    const double across = a + (b - 3000.0) / 100.0;
    return across < 0.0 ? -across : 3.0 * across;
  });
  TakagiSugenoOptions options = Rules(2);
  const double projected =
      MeanSquaredError(FitTakagiSugeno(data, options), data);
  options.antecedent_kind = AntecedentKind::kProductSpace;
  const auto rules = FitTakagiSugeno(data, options);

  ASSERT_EQ(rules.size(), 2U);
  EXPECT_EQ(rules[0].center.size(), 2U);
  EXPECT_LT(MeanSquaredError(rules, data), 0.5 * projected);
}

// Antecedents on the second column alone: the first one is nowhere.
TEST(TakagiSugenoFitTest, TheDistanceIsOverTheAntecedentsAlone) {
  TakagiSugenoOptions options = Rules(3);
  options.antecedent_kind = AntecedentKind::kProductSpace;
  options.antecedents = {1};
  const RegressionData data = Sampled(300, Hills);
  const auto rules = FitTakagiSugeno(data, options);
  MatrixXd moved = data.x;
  moved.col(0).setConstant(1e3);

  EXPECT_EQ(DegreesOfFulfilment(rules, moved),
            DegreesOfFulfilment(rules, data.x));
}

TEST(TakagiSugenoFitTest, RefusesUnusableData) {
  RegressionData data = Sampled(20, Rising);
  EXPECT_THROW(FitTakagiSugeno(data, Rules(7)), std::invalid_argument);
  EXPECT_THROW(FitTakagiSugeno(data, Rules(0)), std::invalid_argument);
  data.x(3, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(FitTakagiSugeno(data, Rules(2)), std::invalid_argument);
  data = Sampled(20, Rising);
  data.y.conservativeResize(19);
  EXPECT_THROW(FitTakagiSugeno(data, Rules(2)), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
