#include "trainer/gustafson_kessel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <stdexcept>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Two segments of length 2, one 0.2 above the other, 1e-3 thick.
MatrixXd ParallelSegments(Index per_segment) {
  MatrixXd z(2 * per_segment, 2);
  std::mt19937 generator(3);
  std::normal_distribution<double> thickness(0.0, 1e-3);
  for (Index k = 0; k < 2 * per_segment; ++k) {
    const auto along = static_cast<double>(k % per_segment);
    z(k, 0) = -1.0 + 2.0 * along / static_cast<double>(per_segment - 1);
    z(k, 1) = (k < per_segment ? 0.0 : 0.2) + thickness(generator);
  }
  return z;
}

// Three Gaussian clouds of different shape in three dimensions.
MatrixXd Clouds(Index rows) {
  std::mt19937 generator(11);
  std::normal_distribution<double> normal;
  MatrixXd z(rows, 3);
  for (Index k = 0; k < rows; ++k) {
    const double a = normal(generator);
    const double b = normal(generator);
    const double c = normal(generator);
    switch (k % 3) {
      case 0:
        z.row(k) << a, 0.1 * b, 0.2 * c;
        break;
      case 1:
        z.row(k) << 4.0 + 0.2 * a, 3.0 + b, a + 0.3 * c;
        break;
      default:
        z.row(k) << -3.0 + 0.5 * a, 4.0 + 0.5 * b, -2.0 + 0.5 * c;
    }
  }
  return z;
}

GustafsonKesselOptions Clusters(int count) {
  GustafsonKesselOptions options;
  options.num_clusters = count;
  return options;
}

// Aᵢ = det(Fᵢ)^(1/n) Fᵢ⁻¹.
MatrixXd NormInducing(const MatrixXd& f) {
  return std::pow(f.determinant(), 1.0 / static_cast<double>(f.rows())) *
         f.inverse();
}

// Memberships by the definition, one point at a time.
MatrixXd RecomputedMemberships(const MatrixXd& z, const FuzzyPartition& p,
                               double m) {
  MatrixXd u(z.rows(), p.centers.rows());
  for (Index k = 0; k < z.rows(); ++k) {
    VectorXd d(p.centers.rows());
    for (Index i = 0; i < d.size(); ++i) {
      const VectorXd e = (z.row(k) - p.centers.row(i)).transpose();
      d(i) =
          e.dot(NormInducing(p.covariances[static_cast<std::size_t>(i)]) * e);
    }
    for (Index i = 0; i < d.size(); ++i) {
      double sum = 0.0;
      for (Index j = 0; j < d.size(); ++j) {
        sum += std::pow(d(i) / d(j), 1.0 / (m - 1.0));
      }
      u(k, i) = 1.0 / sum;
    }
  }
  return u;
}

// Segments this thin defeat Euclidean fuzzy c-means, which cuts them left and
// right of the middle.
TEST(GustafsonKesselTest, SeparatesParallelSegments) {
  const FuzzyPartition p =
      FitGustafsonKessel(ParallelSegments(100), Clusters(2));

  ASSERT_TRUE(p.converged);
  ASSERT_TRUE(p.separated);
  const Index lower = p.centers(0, 1) < p.centers(1, 1) ? 0 : 1;
  EXPECT_NEAR(p.centers(lower, 1), 0.0, 0.01);
  EXPECT_NEAR(p.centers(1 - lower, 1), 0.2, 0.01);
  EXPECT_GT(p.memberships.col(lower).head(100).minCoeff(), 0.9);
  EXPECT_GT(p.memberships.col(1 - lower).tail(100).minCoeff(), 0.9);
}

class FuzzinessTest : public testing::TestWithParam<double> {};

// At the end of the iteration every part of the solution follows from the
// others by its own formula.
TEST_P(FuzzinessTest, SolutionIsAStationaryPoint) {
  const MatrixXd z = Clouds(300);
  GustafsonKesselOptions options = Clusters(3);
  options.fuzziness = GetParam();
  options.tolerance = 1e-10;
  options.max_iterations = 2000;
  const FuzzyPartition p = FitGustafsonKessel(z, options);
  ASSERT_TRUE(p.converged);

  const MatrixXd u = RecomputedMemberships(z, p, options.fuzziness);
  EXPECT_LT((u - p.memberships).cwiseAbs().maxCoeff(), 1e-8);
  double objective = 0.0;
  for (Index i = 0; i < 3; ++i) {
    const VectorXd w =
        p.memberships.col(i).array().pow(options.fuzziness).matrix();
    const VectorXd v = z.transpose() * w / w.sum();
    EXPECT_LT((v.transpose() - p.centers.row(i)).cwiseAbs().maxCoeff(), 1e-8);
    const MatrixXd e = z.rowwise() - v.transpose();
    const MatrixXd f = e.transpose() * w.asDiagonal() * e / w.sum();
    const MatrixXd& found = p.covariances[static_cast<std::size_t>(i)];
    EXPECT_LT((f - found).cwiseAbs().maxCoeff(), 1e-8);
    objective +=
        w.dot((e * NormInducing(found)).cwiseProduct(e).rowwise().sum());
  }
  EXPECT_NEAR(p.objective, objective, 1e-6 * objective);
}

INSTANTIATE_TEST_SUITE_P(M, FuzzinessTest, testing::Values(1.5, 2.0, 2.5));

TEST(GustafsonKesselTest, MembershipsOfEachPointSumToOne) {
  const FuzzyPartition p = FitGustafsonKessel(Clouds(200), Clusters(4));

  EXPECT_LT((p.memberships.rowwise().sum().array() - 1.0).abs().maxCoeff(),
            1e-14);
  EXPECT_GE(p.memberships.minCoeff(), 0.0);
}

TEST(GustafsonKesselTest, OrderOfTheRowsDoesNotMatter) {
  const MatrixXd z = Clouds(600);
  std::vector<Index> order(600);
  std::iota(order.begin(), order.end(), Index{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(5));

  GustafsonKesselOptions options = Clusters(3);
  options.coarse_points = 200;
  const FuzzyPartition p = FitGustafsonKessel(z, options);
  const FuzzyPartition q =
      FitGustafsonKessel(MatrixXd(z(order, Eigen::all)), options);

  EXPECT_EQ(p.centers, q.centers);
  EXPECT_EQ(MatrixXd(p.memberships(order, Eigen::all)), q.memberships);
}

TEST(GustafsonKesselTest, SameSeedGivesTheSameBits) {
  const MatrixXd z = Clouds(150);
  const FuzzyPartition p = FitGustafsonKessel(z, Clusters(5));
  const FuzzyPartition q = FitGustafsonKessel(z, Clusters(5));

  EXPECT_EQ(p.memberships, q.memberships);
  EXPECT_EQ(p.objective, q.objective);
}

TEST(GustafsonKesselTest, MoreStartsNeverRaiseTheObjective) {
  const MatrixXd z = Clouds(150);
  GustafsonKesselOptions options = Clusters(5);
  double previous = std::numeric_limits<double>::infinity();
  for (int starts = 1; starts <= 6; ++starts) {
    options.num_starts = starts;
    const double objective = FitGustafsonKessel(z, options).objective;
    EXPECT_LE(objective, previous);
    previous = objective;
  }
}

// The subset only chooses where to begin: what is returned is stationary on
// all points.
TEST(GustafsonKesselTest, CoarseStartsEndOnAllPoints) {
  const MatrixXd z = Clouds(900);
  GustafsonKesselOptions options = Clusters(3);
  options.coarse_points = 200;
  options.tolerance = 1e-9;
  options.max_iterations = 1000;
  const FuzzyPartition coarse = FitGustafsonKessel(z, options);
  options.coarse_points = 0;
  const FuzzyPartition full = FitGustafsonKessel(z, options);

  ASSERT_EQ(coarse.memberships.rows(), 900);
  EXPECT_NEAR(coarse.objective, full.objective, 1e-6 * full.objective);
  EXPECT_LT((RecomputedMemberships(z, coarse, 2.0) - coarse.memberships)
                .cwiseAbs()
                .maxCoeff(),
            1e-7);
}

// Points on two lines: without a bound on cond(Fᵢ) the covariances are
// singular.
TEST(GustafsonKesselTest, CollinearPointsStaySolvableWithinTheBound) {
  MatrixXd z(200, 2);
  for (Index k = 0; k < 200; ++k) {
    const double t = static_cast<double>(k % 100) / 50.0 - 1.0;
    z.row(k) << t, (k < 100 ? t : 1.5 - t);
  }
  GustafsonKesselOptions options = Clusters(2);
  options.max_condition = 1e8;
  const FuzzyPartition p = FitGustafsonKessel(z, options);

  ASSERT_TRUE(p.memberships.allFinite());
  for (const MatrixXd& f : p.covariances) {
    const VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(f).eigenvalues();
    EXPECT_GT(eigenvalues.minCoeff(), 0.0);
    EXPECT_LE(eigenvalues.maxCoeff() / eigenvalues.minCoeff(), 1.001e8);
  }
  const Index first = p.memberships(10, 0) > 0.5 ? 0 : 1;
  EXPECT_GT(p.memberships.col(first).head(20).minCoeff(), 0.9);
  EXPECT_GT(p.memberships.col(1 - first).segment(100, 20).minCoeff(), 0.9);
}

// With γ = 1 every Fᵢ is det(F₀)^(1/n) I, hence Aᵢ = I: fuzzy c-means.
TEST(GustafsonKesselTest, FullWeightOfTheCommonCovarianceIsFuzzyCMeans) {
  const MatrixXd z = Clouds(300);
  GustafsonKesselOptions options = Clusters(3);
  options.covariance_weight = 1.0;
  const FuzzyPartition p = FitGustafsonKessel(z, options);

  const MatrixXd e = z.rowwise() - z.colwise().mean();
  const MatrixXd f0 = e.transpose() * e / 300.0;
  const double spread = std::cbrt(f0.determinant());
  for (const MatrixXd& f : p.covariances) {
    EXPECT_LT((f - spread * MatrixXd::Identity(3, 3)).cwiseAbs().maxCoeff(),
              1e-12 * spread);
  }
}

TEST(GustafsonKesselTest, APointOnACenterBelongsToItAlone) {
  // Two symmetric crosses, whose middle points are the centers.
  MatrixXd z(10, 2);
  z << 0, 0, 1, 0, -1, 0, 0, 1, 0, -1,  //
      50, 0, 51, 0, 49, 0, 50, 1, 50, -1;
  const FuzzyPartition p = FitGustafsonKessel(z, Clusters(2));

  ASSERT_TRUE(p.memberships.allFinite());
  EXPECT_GT(p.memberships.row(0).maxCoeff(), 0.999);
  EXPECT_GT(p.memberships.row(5).maxCoeff(), 0.999);
}

TEST(GustafsonKesselTest, IdenticalPointsAreReportedAsNotSeparated) {
  const FuzzyPartition p =
      FitGustafsonKessel(MatrixXd::Constant(50, 3, 2.0), Clusters(2));

  EXPECT_TRUE(p.memberships.allFinite());
  EXPECT_FALSE(p.separated);
}

TEST(GustafsonKesselTest, IterationLimitIsReportedNotThrown) {
  GustafsonKesselOptions options = Clusters(2);
  options.max_iterations = 1;
  EXPECT_FALSE(FitGustafsonKessel(ParallelSegments(50), options).converged);
}

TEST(GustafsonKesselTest, ConvergesNoEarlierThanTheLeastIterations) {
  GustafsonKesselOptions options = Clusters(2);
  options.tolerance = 1.0;
  options.min_iterations = 17;
  EXPECT_EQ(FitGustafsonKessel(ParallelSegments(50), options).iterations, 17);
}

TEST(GustafsonKesselTest, RefusesArgumentsOutOfRange) {
  MatrixXd z = Clouds(30);
  GustafsonKesselOptions options = Clusters(1);
  EXPECT_THROW(FitGustafsonKessel(z, options), std::invalid_argument);
  options = Clusters(2);
  options.fuzziness = 1.0;
  EXPECT_THROW(FitGustafsonKessel(z, options), std::invalid_argument);
  options = Clusters(2);
  options.covariance_weight = 1.5;
  EXPECT_THROW(FitGustafsonKessel(z, options), std::invalid_argument);
  EXPECT_THROW(FitGustafsonKessel(z, Clusters(30)), std::invalid_argument);
  z(7, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(FitGustafsonKessel(z, Clusters(2)), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::trainer
