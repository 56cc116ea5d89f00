#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "trainer/cluster_antecedents.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double Membership(const FuzzySet& set, double x) {
  const double left = std::max(0.0, set.left_center - x) / set.left_width;
  const double right = std::max(0.0, x - set.right_center) / set.right_width;
  return std::exp(-0.5 * (left * left + right * right));
}

TEST(AntecedentProjectionTest, EnvelopeRisesToOneThenFallsAndCoversThePoints) {
  std::mt19937 generator(2);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  VectorXd x(500);
  VectorXd u(500);
  for (Index k = 0; k < 500; ++k) {
    x(k) = 10.0 * uniform(generator) - 5.0;
    u(k) = 0.8 * std::exp(-x(k) * x(k)) * uniform(generator);
  }
  const Envelope envelope = ProjectMembership(x, u);

  Index peak = 0;
  EXPECT_DOUBLE_EQ(envelope.heights.maxCoeff(&peak), 1.0);
  for (Index k = 1; k < 500; ++k) {
    EXPECT_LE(envelope.positions(k - 1), envelope.positions(k));
    const double step = envelope.heights(k) - envelope.heights(k - 1);
    EXPECT_TRUE(k <= peak ? step >= 0.0 : step <= 0.0) << k;
  }
  for (Index k = 0; k < 500; ++k) {
    const auto at = std::lower_bound(envelope.positions.begin(),
                                     envelope.positions.end(), x(k)) -
                    envelope.positions.begin();
    EXPECT_GE(envelope.heights(at) * u.maxCoeff(), u(k) * (1.0 - 1e-14));
  }
}

TEST(AntecedentProjectionTest, EqualPositionsShareTheLargestMembership) {
  VectorXd x(5);
  x << 3, 1, 2, 1, 2;
  VectorXd u(5);
  u << .2, .1, .4, .3, .5;
  const Envelope envelope = ProjectMembership(x, u);

  VectorXd expected(5);
  expected << .6, .6, 1., 1., .4;
  EXPECT_LT((envelope.heights - expected).cwiseAbs().maxCoeff(), 1e-15);
}

// Positions so far apart that none lies between the core and height 0.95.
TEST(AntecedentProjectionTest, RecoversATwoSidedGaussianWithACore) {
  const FuzzySet truth{-1.0, 2.0, 1.0, 1.5};
  const VectorXd x = VectorXd::LinSpaced(19, -6.0, 12.0);
  const FuzzySet set = FitFuzzySet(
      {x, x.unaryExpr([&](double p) { return Membership(truth, p); })}, 1e-3);

  EXPECT_EQ(set.left_center, -1.0);
  EXPECT_EQ(set.right_center, 2.0);
  EXPECT_NEAR(set.left_width, 1.0, 2e-3);
  EXPECT_NEAR(set.right_width, 1.5, 3e-3);
}

TEST(AntecedentProjectionTest, ASideWithoutPointsGetsTheLeastWidth) {
  const Envelope envelope{VectorXd::LinSpaced(10, 0.0, 1.0),
                          VectorXd::Ones(10)};
  const FuzzySet set = FitFuzzySet(envelope, 0.01);

  EXPECT_EQ(set.left_center, 0.0);
  EXPECT_EQ(set.right_center, 1.0);
  EXPECT_EQ(set.left_width, 0.01);
  EXPECT_EQ(set.right_width, 0.01);
}

TEST(AntecedentProjectionTest, OnlyTheOutermostSetsHaveShoulders) {
  const VectorXd x = VectorXd::LinSpaced(300, 0.0, 3.0);
  MatrixXd u(300, 3);
  for (Index i = 0; i < 3; ++i) {
    const double center = 0.5 + static_cast<double>((i + 1) % 3);
    u.col(i) = (-(x.array() - center).square() / 0.1).exp();
  }
  const auto sets = ProjectAntecedents(x, u);  // Centers 1.5, 2.5, 0.5.

  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sets[2][0].left_width, infinity);
  EXPECT_EQ(sets[1][0].right_width, infinity);
  EXPECT_TRUE(std::isfinite(sets[0][0].left_width));
  EXPECT_TRUE(std::isfinite(sets[0][0].right_width));
  EXPECT_TRUE(std::isfinite(sets[2][0].right_width));
  EXPECT_TRUE(std::isfinite(sets[1][0].left_width));
}

// Column 0 is constant; on column 1 cluster 0 is a single position.
TEST(AntecedentProjectionTest, DegenerateDimensionsGiveUsableSets) {
  MatrixXd x(40, 2);
  MatrixXd u(40, 2);
  for (Index k = 0; k < 40; ++k) {
    x.row(k) << 7.0, (k < 20 ? 1.0 : 1.0 + static_cast<double>(k));
    u.row(k) << (k < 20 ? 1.0 : 0.0), (k < 20 ? 0.0 : 1.0);
  }
  const auto sets = ProjectAntecedents(x, u);

  for (const auto& rule : sets) {
    EXPECT_EQ(Membership(rule[0], -1e9), 1.0);
    EXPECT_EQ(Membership(rule[0], 1e9), 1.0);
    EXPECT_GT(rule[1].left_width, 0.0);
    EXPECT_GT(rule[1].right_width, 0.0);
    EXPECT_LE(rule[1].left_center, rule[1].right_center);
  }
  EXPECT_NEAR(Membership(sets[0][1], 1.0), 1.0, 1e-12);
  EXPECT_LT(Membership(sets[0][1], 21.0), 1e-6);
}

TEST(AntecedentProjectionTest, RefusesSizesThatDoNotMatch) {
  EXPECT_THROW(ProjectMembership(VectorXd::Ones(3), VectorXd::Ones(2)),
               std::invalid_argument);
  EXPECT_THROW(ProjectAntecedents(MatrixXd::Ones(3, 1), MatrixXd::Ones(2, 2)),
               std::invalid_argument);
  EXPECT_THROW(FitFuzzySet({VectorXd::Ones(2), VectorXd::Ones(2)}, 0.0),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
