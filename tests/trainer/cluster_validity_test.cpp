#include <stdexcept>

#include <gtest/gtest.h>

#include "trainer/gustafson_kessel.h"

namespace fdi::trainer {
namespace {

FuzzyPartition Partition(const Eigen::MatrixXd& memberships,
                         const Eigen::MatrixXd& centers) {
  FuzzyPartition partition;
  partition.memberships = memberships;
  partition.centers = centers;
  return partition;
}

// Points 0, 1, 9, 10; centers 0 and 10, mean 5. With m = 2:
// k=0: 1·(0 − 25)                      = −25
// k=1: .64·(1 − 25) + .04·(81 − 25)    = −13.12
// and the mirror image, −76.24 in all.
TEST(ClusterValidityTest, MatchesACalculationByHand) {
  Eigen::MatrixXd z(4, 1);
  z << 0, 1, 9, 10;
  Eigen::MatrixXd u(4, 2);
  u << 1, 0, .8, .2, .2, .8, 0, 1;
  Eigen::MatrixXd v(2, 1);
  v << 0, 10;

  EXPECT_NEAR(SugenoYasukawa(z, Partition(u, v)), -76.24, 1e-12);
}

// The scatter of 0, 1, 9, 10 about 5 is 25 + 16 + 16 + 25.
TEST(ClusterValidityTest, OneClusterHasTheTotalScatter) {
  Eigen::MatrixXd z(4, 1);
  z << 0, 1, 9, 10;

  EXPECT_NEAR(SugenoYasukawa(z, Partition(Eigen::MatrixXd::Ones(4, 1),
                                          Eigen::MatrixXd::Constant(1, 1, 5))),
              82.0, 1e-12);
}

TEST(ClusterValidityTest, TwoFarGroupsMakeTwoClustersTheBestNumber) {
  Eigen::MatrixXd z(60, 2);
  for (Eigen::Index k = 0; k < 60; ++k) {
    const auto t = static_cast<double>(k / 2);
    z.row(k) << (k % 2 == 0 ? -5.0 : 5.0) + 0.1 * (static_cast<int>(t) % 5),
        0.1 * (static_cast<int>(t) % 7);
  }
  double score[5] = {};
  for (int c = 2; c <= 4; ++c) {
    GustafsonKesselOptions options;
    options.num_clusters = c;
    options.covariance_weight = 1.0;  // Round clusters.
    score[c] = SugenoYasukawa(z, FitGustafsonKessel(z, options));
  }

  EXPECT_LT(score[2], score[3]);
  EXPECT_LT(score[2], score[4]);
}

TEST(ClusterValidityTest, RefusesSizesThatDoNotMatch) {
  const Eigen::MatrixXd z = Eigen::MatrixXd::Ones(4, 2);
  EXPECT_THROW(SugenoYasukawa(z, Partition(Eigen::MatrixXd::Ones(3, 1),
                                           Eigen::MatrixXd::Ones(1, 2))),
               std::invalid_argument);
  EXPECT_THROW(SugenoYasukawa(z, Partition(Eigen::MatrixXd::Ones(4, 1),
                                           Eigen::MatrixXd::Ones(2, 2))),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
