#include <cmath>
#include <random>
#include <stdexcept>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomMatrix(Index rows, Index cols, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, cols, [&] { return normal(generator); });
}

// Positive weights whose rows sum to 1.
MatrixXd RandomWeights(Index rows, Index cols, unsigned seed) {
  const MatrixXd w = RandomMatrix(rows, cols, seed).array().exp();
  return w.array().colwise() / w.rowwise().sum().array();
}

class ConsequentMethodTest : public testing::TestWithParam<ConsequentMethod> {};

TEST_P(ConsequentMethodTest, RecoversOneLinearFunctionExactly) {
  MatrixXd x = RandomMatrix(200, 3, 1);
  x.col(1).array() = 3500.0 + 175.0 * x.col(1).array();  // Like P1.
  const Eigen::Vector3d slopes(2.0, -0.003, 0.5);
  const VectorXd y = (x * slopes).array() + 7.0;
  const Consequents found =
      EstimateConsequents(x, y, RandomWeights(200, 1, 2), {GetParam(), 0.0});

  EXPECT_LT((found.slopes.row(0).transpose() - slopes).cwiseAbs().maxCoeff(),
            1e-12);
  EXPECT_NEAR(found.intercepts(0), 7.0, 1e-9);
}

// A model with known consequents: global estimation returns them.
TEST(ConsequentEstimationTest, GlobalRecoversTheRulesOfABlend) {
  const MatrixXd x = RandomMatrix(400, 2, 3);
  const MatrixXd w = RandomWeights(400, 3, 4);
  const MatrixXd slopes = RandomMatrix(3, 2, 5);
  const VectorXd intercepts = RandomMatrix(3, 1, 6);
  const VectorXd y =
      ((x * slopes.transpose()).rowwise() + intercepts.transpose())
          .cwiseProduct(w)
          .rowwise()
          .sum();
  const Consequents found =
      EstimateConsequents(x, y, w, {ConsequentMethod::kGlobal, 0.0});

  EXPECT_LT((found.slopes - slopes).cwiseAbs().maxCoeff(), 1e-11);
  EXPECT_LT((found.intercepts - intercepts).cwiseAbs().maxCoeff(), 1e-11);
}

// Against the normal equations, well conditioned here.
TEST(ConsequentEstimationTest, LocalSolvesTheWeightedNormalEquations) {
  const MatrixXd x = RandomMatrix(300, 3, 7);
  const VectorXd y = RandomMatrix(300, 1, 8);
  const MatrixXd w = RandomWeights(300, 2, 9);
  const Consequents found = EstimateConsequents(x, y, w);

  MatrixXd xe(300, 4);
  xe << x, VectorXd::Ones(300);
  for (Index i = 0; i < 2; ++i) {
    const MatrixXd xw = xe.transpose() * w.col(i).asDiagonal();
    const VectorXd theta = (xw * xe).ldlt().solve(xw * y);
    EXPECT_LT(
        (found.slopes.row(i).transpose() - theta.head(3)).cwiseAbs().maxCoeff(),
        1e-11);
    EXPECT_NEAR(found.intercepts(i), theta(3), 1e-11);
  }
}

// Two equal columns: any split of the slope fits; the smallest halves it.
TEST_P(ConsequentMethodTest, EqualColumnsShareTheSlope) {
  MatrixXd x = RandomMatrix(100, 2, 10);
  x.col(1) = x.col(0);
  const VectorXd y = 4.0 * x.col(0).array() + 1.0;
  const Consequents found =
      EstimateConsequents(x, y, MatrixXd::Ones(100, 1), {GetParam(), 0.0});

  EXPECT_NEAR(found.slopes(0, 0), 2.0, 1e-9);
  EXPECT_NEAR(found.slopes(0, 1), 2.0, 1e-9);
  EXPECT_NEAR(found.intercepts(0), 1.0, 1e-9);
}

TEST_P(ConsequentMethodTest, AConstantColumnGetsNoSlope) {
  MatrixXd x = RandomMatrix(100, 2, 11);
  x.col(1).setConstant(43.0);
  const VectorXd y = 4.0 * x.col(0).array() + 1.0;
  const Consequents found =
      EstimateConsequents(x, y, MatrixXd::Ones(100, 1), {GetParam(), 0.0});

  EXPECT_NEAR(found.slopes(0, 0), 4.0, 1e-11);
  EXPECT_NEAR(found.slopes(0, 1), 0.0, 1e-11);
  EXPECT_NEAR(found.intercepts(0), 1.0, 1e-9);
}

// One standardized regressor: the slope shrinks by 1/(1 + ridge).
TEST_P(ConsequentMethodTest, RidgeShrinksAStandardizedSlopeAsPredicted) {
  const MatrixXd x = 50.0 * RandomMatrix(100, 1, 12);
  const VectorXd y = 3.0 * x.col(0).array() - 2.0;
  const Consequents found =
      EstimateConsequents(x, y, MatrixXd::Ones(100, 1), {GetParam(), 0.25});

  EXPECT_NEAR(found.slopes(0, 0), 3.0 / 1.25, 1e-11);
  EXPECT_NEAR(found.slopes(0, 0) * x.mean() + found.intercepts(0), y.mean(),
              1e-9);
}

TEST_P(ConsequentMethodTest, ARuleWithoutWeightStaysFinite) {
  const MatrixXd x = RandomMatrix(100, 2, 13);
  const VectorXd y = RandomMatrix(100, 1, 14);
  MatrixXd w = MatrixXd::Zero(100, 2);
  w.col(0).setOnes();
  const Consequents found = EstimateConsequents(x, y, w, {GetParam(), 0.0});

  EXPECT_TRUE(found.slopes.allFinite());
  EXPECT_TRUE(found.intercepts.allFinite());
  EXPECT_TRUE(found.slopes.row(1).isZero(1e-12));
}

INSTANTIATE_TEST_SUITE_P(Methods, ConsequentMethodTest,
                         testing::Values(ConsequentMethod::kLocal,
                                         ConsequentMethod::kGlobal));

TEST(ConsequentEstimationTest, RefusesSizesThatDoNotMatch) {
  const MatrixXd x = MatrixXd::Ones(5, 2);
  EXPECT_THROW(EstimateConsequents(x, VectorXd::Ones(4), MatrixXd::Ones(5, 1)),
               std::invalid_argument);
  EXPECT_THROW(EstimateConsequents(x, VectorXd::Ones(5), MatrixXd::Ones(4, 1)),
               std::invalid_argument);
  EXPECT_THROW(EstimateConsequents(x, VectorXd::Ones(5), MatrixXd::Ones(5, 1),
                                   {ConsequentMethod::kLocal, -1.0}),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
