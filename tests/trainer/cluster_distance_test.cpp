#include <cmath>
#include <stdexcept>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "trainer/gustafson_kessel.h"
#include "trainer/takagi_sugeno_fit.h"

namespace fdi::trainer {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// log β of a rule against that of one that always fires: w/(1 − w) = β.
double LogFulfilment(const TsRule& rule, const VectorXd& x) {
  TsRule always;
  always.antecedents.assign(rule.antecedents.size(), rule.antecedents[0]);
  const MatrixXd w = DegreesOfFulfilment({rule, always}, x.transpose());
  return std::log(w(0, 0) / w(0, 1));
}

TEST(ClusterDistanceTest, IsTheMahalanobisDistanceOfTheNamedColumns) {
  VectorXd center(2);
  center << 50.0, 3500.0;
  MatrixXd covariance(2, 2);
  covariance << 25.0, 300.0, 300.0, 10000.0;
  TsRule rule;
  PlaceByDistance({1, 3}, center, covariance, 5, rule);
  VectorXd x(5);
  x << 7.0, 57.0, -4.0, 3420.0, 1e4;

  const VectorXd d = VectorXd(x(Eigen::seqN(1, 2, 2))) - center;
  EXPECT_NEAR(LogFulfilment(rule, x), -0.5 * d.dot(covariance.inverse() * d),
              1e-12);
  EXPECT_EQ(rule.center.size(), 4U);
  EXPECT_EQ(rule.metric.size(), 10U);
  EXPECT_EQ(rule.antecedents.size(), 5U);
}

TEST(ClusterDistanceTest, RefusesWhatIsNoCovariance) {
  TsRule rule;
  const VectorXd center = VectorXd::Zero(2);
  EXPECT_THROW(
      PlaceByDistance({0, 1}, center, -MatrixXd::Identity(2, 2), 2, rule),
      std::invalid_argument);
  EXPECT_THROW(
      PlaceByDistance({0, 2}, center, MatrixXd::Identity(2, 2), 2, rule),
      std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
