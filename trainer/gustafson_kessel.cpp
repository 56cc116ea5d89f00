#include "trainer/gustafson_kessel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "base/error.h"

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::ArrayXXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A number in [0, 1) of 53 random bits: the library's distributions are not
// the same everywhere.
double Uniform(std::mt19937_64& generator) {
  return static_cast<double>(generator() >> 11U) * 0x1p-53;
}

// A start for FitGustafsonKessel(): spheres around centers among the points
// Z, N×n, each drawn with a probability proportional to the squared distance
// from the nearest one drawn before. Fills centers and covariances.
FuzzyPartition DrawCenters(const Eigen::Ref<const MatrixXd>& z,
                           Index num_clusters, unsigned seed) {
  std::mt19937_64 generator(seed);
  FuzzyPartition start;
  start.centers.resize(num_clusters, z.cols());
  start.covariances.assign(static_cast<std::size_t>(num_clusters),
                           MatrixXd::Identity(z.cols(), z.cols()));
  ArrayXd nearest = ArrayXd::Ones(z.rows());
  for (Index i = 0; i < num_clusters; ++i) {
    double left = Uniform(generator) * nearest.sum();
    Index k = 0;
    while (k + 1 < z.rows() && left >= nearest(k)) {
      left -= nearest(k);
      ++k;
    }
    start.centers.row(i) = z.row(k);
    const ArrayXd squared =
        (z.rowwise() - z.row(k)).rowwise().squaredNorm().array();
    nearest = i == 0 ? squared : nearest.min(squared).eval();
  }
  return start;
}

// A start for FitGustafsonKessel(): memberships at random, each row summing
// to 1. All clusters begin in the middle, so that thin parallel ones are not
// cut across. Fills the memberships.
FuzzyPartition DrawMemberships(Index rows, Index num_clusters, unsigned seed) {
  std::mt19937_64 generator(seed);
  FuzzyPartition start;
  start.memberships = MatrixXd::NullaryExpr(
      rows, num_clusters, [&generator] { return Uniform(generator); });
  const ArrayXd sum = start.memberships.rowwise().sum().array().max(
      std::numeric_limits<double>::min());
  start.memberships.array().colwise() /= sum;
  return start;
}

constexpr double kMinPositive = std::numeric_limits<double>::min();
// Factor on the tolerance while starts compete on a subset of the points.
constexpr double kCoarseTolerance = 10.0;

void CheckArguments(const Eigen::Ref<const MatrixXd>& points,
                    const GustafsonKesselOptions& options) {
  Require(options.num_clusters >= 2, "num_clusters must be at least 2");
  Require(options.fuzziness > 1.0, "fuzziness must be above 1");
  Require(options.tolerance > 0.0, "tolerance must be above 0");
  Require(options.max_iterations >= 1, "max_iterations must be at least 1");
  Require(options.covariance_weight >= 0.0 && options.covariance_weight <= 1.0,
          "covariance_weight must be within 0 to 1");
  Require(options.max_condition >= 1.0, "max_condition must be at least 1");
  Require(options.num_starts >= 1, "num_starts must be at least 1");
  Require(options.coarse_points >= 0, "coarse_points must not be negative");
  Require(points.cols() >= 1, "points need at least one column");
  Require(points.rows() > options.num_clusters,
          "points need more rows than clusters");
  Require(points.allFinite(), "points must be finite numbers");
}

// The rows of Z in lexicographic order.
std::vector<Index> LexicographicOrder(const Eigen::Ref<const MatrixXd>& z) {
  std::vector<Index> order(static_cast<std::size_t>(z.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  // Equal rows are interchangeable, so the sort need not be stable.
  std::sort(order.begin(), order.end(), [&z](Index a, Index b) {
    for (Index j = 0; j < z.cols(); ++j) {
      if (z(a, j) != z(b, j)) {
        return z(a, j) < z(b, j);
      }
    }
    return false;
  });
  return order;
}

// log det F of a matrix given by its eigenvalues.
// A sum of logarithms neither underflows nor overflows where the product of the
// eigenvalues would.
double LogDeterminant(const VectorXd& eigenvalues) {
  return eigenvalues.array().log().sum();
}

// Rows 0, stride, 2 stride, ... of Z.
MatrixXd Thinned(const MatrixXd& z, Index stride) {
  return z(Eigen::seq(0, Eigen::last, stride), Eigen::all);
}

// The alternating minimization over fixed points Z, N×n. All buffers of size N
// are allocated once; a step works on whole columns.
class Iteration {
 public:
  Iteration(const MatrixXd& z, const GustafsonKesselOptions& options)
      : z_(z),
        options_(options),
        u_(ArrayXXd::Zero(z.rows(), options.num_clusters)),
        distances_(z.rows(), options.num_clusters),
        centered_(z.rows(), z.cols()),
        weights_(z.rows()),
        scratch_(z.rows()),
        nearest_(z.rows()),
        centers_(options.num_clusters, z.cols()),
        covariances_(static_cast<std::size_t>(options.num_clusters),
                     MatrixXd::Identity(z.cols(), z.cols())) {
    PrepareRegularization();
  }

  // Iterates from the memberships of `start` if they are of these points, else
  // from its centers and covariances.
  FuzzyPartition Run(const FuzzyPartition& start) {
    if (start.memberships.rows() == z_.rows()) {
      u_ = start.memberships.array();
    } else {
      centers_ = start.centers;
      covariances_ = start.covariances;
      for (Index i = 0; i < u_.cols(); ++i) {
        centered_ = z_.rowwise() - centers_.row(i);
        UpdateDistances(i);
      }
      UpdateMemberships();
    }
    FuzzyPartition result;
    while (result.iterations < options_.max_iterations && !result.converged) {
      for (Index i = 0; i < u_.cols(); ++i) {
        UpdateCluster(i);
        UpdateDistances(i);
      }
      const double change = UpdateMemberships();
      ++result.iterations;
      // Random memberships first lead to a point close to the trivial
      // partition, where every μ is 1/c. That is a fixed point, and the first
      // steps away from it can be smaller than the tolerance.
      result.converged = change < options_.tolerance &&
                         result.iterations >= options_.min_iterations;
    }
    result.objective = Objective();
    result.memberships = u_;
    result.centers = centers_;
    result.covariances = covariances_;
    result.separated =
        u_.maxCoeff() - 1.0 / static_cast<double>(u_.cols()) >= kSeparation;
    return result;
  }

 private:
  static constexpr double kSeparation = 0.1;

  // F₀'s contribution γ det(F₀)^(1/n), and the smallest eigenvalue that is
  // told from rounding.
  void PrepareRegularization() {
    centered_ = z_.rowwise() - z_.colwise().mean();
    const auto count = static_cast<double>(z_.rows());
    const MatrixXd f0 = centered_.transpose() * centered_ / count;
    const auto n = static_cast<double>(z_.cols());
    smallest_eigenvalue_ = std::max(1e-30 * f0.trace() / n, kMinPositive);
    const VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(f0, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .cwiseMax(smallest_eigenvalue_);
    spread_ =
        options_.covariance_weight * std::exp(LogDeterminant(eigenvalues) / n);
  }

  // μ^m of cluster i into weights_; m = 2 and m = 1.5 without pow().
  void UpdateWeights(Index i) {
    if (options_.fuzziness == 2.0) {
      weights_ = u_.col(i).square();
    } else if (options_.fuzziness == 1.5) {
      weights_ = u_.col(i) * u_.col(i).sqrt();
    } else {
      weights_ = u_.col(i).pow(options_.fuzziness);
    }
  }

  // vᵢ and Fᵢ; leaves Z − vᵢ in centered_.
  void UpdateCluster(Index i) {
    const Index n = z_.cols();
    UpdateWeights(i);
    const double total = std::max(weights_.sum(), kMinPositive);
    for (Index a = 0; a < n; ++a) {
      centers_(i, a) = weights_.matrix().dot(z_.col(a)) / total;
      centered_.col(a).array() = z_.col(a).array() - centers_(i, a);
    }
    MatrixXd& f = covariances_[static_cast<std::size_t>(i)];
    for (Index a = 0; a < n; ++a) {
      scratch_ = weights_ * centered_.col(a).array();
      for (Index b = a; b < n; ++b) {
        f(a, b) = f(b, a) = scratch_.matrix().dot(centered_.col(b)) / total;
      }
    }
    f *= 1.0 - options_.covariance_weight;
    f.diagonal().array() += spread_;
  }

  // Raises the small eigenvalues of F and returns upper triangular R with
  // RᵀR = A = det(F)^(1/n) F⁻¹.
  //
  //     F = QΛQᵀ,   S = (det(F)^(1/n) Λ⁻¹)^(1/2) Qᵀ,   SᵀS = A,
  //
  // and R is the triangular factor of S. A itself is never formed: as squares,
  // distances cannot become negative by rounding, however flat the cluster is,
  // and R needs half the products of S.
  MatrixXd NormInducingFactor(MatrixXd& f) const {
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(f);
    const double floor =
        std::max(solver.eigenvalues().maxCoeff() / options_.max_condition,
                 smallest_eigenvalue_);
    const VectorXd eigenvalues = solver.eigenvalues().cwiseMax(floor);
    const MatrixXd& q = solver.eigenvectors();
    f = q * eigenvalues.asDiagonal() * q.transpose();
    const double scale =
        std::exp(LogDeterminant(eigenvalues) / static_cast<double>(f.rows()));
    const VectorXd root = (scale / eigenvalues.array()).sqrt();
    const MatrixXd square_root = root.asDiagonal() * q.transpose();
    return square_root.householderQr()
        .matrixQR()
        .triangularView<Eigen::Upper>();
  }

  // Dᵢₖ = ‖R (zₖ − vᵢ)‖², from centered_.
  void UpdateDistances(Index i) {
    const MatrixXd r =
        NormInducingFactor(covariances_[static_cast<std::size_t>(i)]);
    distances_.col(i).setZero();
    for (Index a = 0; a < r.cols(); ++a) {
      scratch_ = r(a, a) * centered_.col(a).array();
      for (Index b = a + 1; b < r.cols(); ++b) {
        scratch_ += r(a, b) * centered_.col(b).array();
      }
      distances_.col(i) += scratch_.square();
    }
  }

  // U from the distances; returns max|ΔU|. A point on a center has a distance
  // of 0: the floor gives it to that center, or evenly to those it lies on.
  //
  //     μₖᵢ = ρₖᵢ / Σⱼ ρₖⱼ,   ρₖᵢ = (minⱼ Dₖⱼ / Dₖᵢ)^(1/(m−1)) ≤ 1;
  //
  // relative to the nearest center the power cannot overflow. weights_ holds
  // 1/Σⱼ ρₖⱼ, and Ratio(i) leaves ρᵢ in scratch_ for the assignment to U.
  double UpdateMemberships() {
    distances_ = distances_.max(kMinPositive);
    nearest_ = distances_.rowwise().minCoeff();
    weights_.setZero();
    for (Index i = 0; i < u_.cols(); ++i) {
      weights_ += Ratio(i);
    }
    weights_ = weights_.inverse();
    double change = 0.0;
    for (Index i = 0; i < u_.cols(); ++i) {
      change =
          std::max(change, (Ratio(i) * weights_ - u_.col(i)).abs().maxCoeff());
      u_.col(i) = scratch_ * weights_;
    }
    return change;
  }

  // (min_j Dⱼₖ / Dᵢₖ)^(1/(m−1)) in scratch_.
  const ArrayXd& Ratio(Index i) {
    scratch_ = nearest_ / distances_.col(i);
    if (options_.fuzziness == 1.5) {
      scratch_ = scratch_.square();
    } else if (options_.fuzziness != 2.0) {
      scratch_ = scratch_.pow(1.0 / (options_.fuzziness - 1.0));
    }
    return scratch_;
  }

  double Objective() {
    double sum = 0.0;
    for (Index i = 0; i < u_.cols(); ++i) {
      UpdateWeights(i);
      sum += (weights_ * distances_.col(i)).sum();
    }
    return sum;
  }

  const MatrixXd& z_;
  const GustafsonKesselOptions& options_;
  ArrayXXd u_;
  ArrayXXd distances_;
  MatrixXd centered_;
  ArrayXd weights_;
  ArrayXd scratch_;
  ArrayXd nearest_;
  MatrixXd centers_;
  std::vector<MatrixXd> covariances_;
  double spread_{0.0};
  double smallest_eigenvalue_{kMinPositive};
};

// True if `a` is the better of two results.
bool Better(const FuzzyPartition& a, const FuzzyPartition& b) {
  if (a.separated != b.separated) {
    return a.separated;
  }
  return a.objective < b.objective;
}

FuzzyPartition BestStart(const MatrixXd& z,
                         const GustafsonKesselOptions& options) {
  Iteration iteration(z, options);
  FuzzyPartition best;
  for (int start = 0; start < options.num_starts; ++start) {
    const auto seed = static_cast<unsigned>(options.seed + start);
    const Index c = options.num_clusters;
    // A single start is a random partition, because centers among the points
    // cut thin parallel clusters across.
    FuzzyPartition next =
        iteration.Run(start % 2 == 1 ? DrawCenters(z, c, seed)
                                     : DrawMemberships(z.rows(), c, seed));
    if (start == 0 || Better(next, best)) {
      best = std::move(next);
    }
  }
  return best;
}

}  // namespace

FuzzyPartition FitGustafsonKessel(const Eigen::Ref<const MatrixXd>& points,
                                  const GustafsonKesselOptions& options) {
  CheckArguments(points, options);
  const std::vector<Index> order = LexicographicOrder(points);
  const MatrixXd sorted = points(order, Eigen::all);

  const Index stride =
      options.coarse_points > 0
          ? std::max(Index{1},
                     sorted.rows() / std::max(options.coarse_points,
                                              options.num_clusters + 1))
          : Index{1};
  GustafsonKesselOptions coarse = options;
  coarse.tolerance *= stride > 1 ? kCoarseTolerance : 1.0;
  FuzzyPartition best = BestStart(Thinned(sorted, stride), coarse);
  if (stride > 1) {
    // The memberships are of other points, so Run() goes on from the centers
    // and covariances.
    best = Iteration(sorted, options).Run(best);
  }

  MatrixXd unsorted(best.memberships.rows(), best.memberships.cols());
  unsorted(order, Eigen::all) = best.memberships;
  best.memberships = std::move(unsorted);
  return best;
}

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void PlaceByDistance(const std::vector<Index>& columns,
                     const Eigen::Ref<const VectorXd>& center,
                     const Eigen::Ref<const MatrixXd>& covariance,
                     Index num_regressors, TsRule& rule) {
  const auto m = static_cast<Index>(columns.size());
  Require(m >= 1 && center.size() == m && covariance.rows() == m &&
              covariance.cols() == m && columns.back() < num_regressors,
          "center and covariance need one entry per antecedent");
  const Eigen::LLT<MatrixXd> factor(covariance);
  Require(factor.info() == Eigen::Success,
          "the covariance of a cluster is not positive definite");
  // F = GGᵀ gives F⁻¹ = G⁻ᵀG⁻¹, so that L = G⁻¹, lower triangular as
  // TsRule::metric stores it. Regressors that are no antecedents get rows and
  // columns of zeros; ascending columns keep L triangular.
  const MatrixXd inverse = factor.matrixL().solve(MatrixXd::Identity(m, m));

  const Index size = columns.back() + 1;
  MatrixXd metric = MatrixXd::Zero(size, size);
  metric(columns, columns) = inverse;
  VectorXd place = VectorXd::Zero(size);
  place(columns) = center;

  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  rule.antecedents.assign(static_cast<std::size_t>(num_regressors),
                          {0.0, 0.0, kInfinity, kInfinity});
  rule.center.assign(place.begin(), place.end());
  rule.metric.clear();
  for (Index row = 0; row < size; ++row) {
    for (Index j = 0; j <= row; ++j) {
      rule.metric.push_back(metric(row, j));
    }
  }
}

double SugenoYasukawa(const Eigen::Ref<const Eigen::MatrixXd>& points,
                      const FuzzyPartition& partition, double fuzziness) {
  const Eigen::MatrixXd& u = partition.memberships;
  const Eigen::MatrixXd& v = partition.centers;
  Require(points.rows() > 0 && u.rows() == points.rows(),
          "memberships need one row per point");
  Require(v.rows() == u.cols() && v.cols() == points.cols(),
          "centers need one row per cluster and one column per dimension");
  const Eigen::RowVectorXd mean = points.colwise().mean();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < v.rows(); ++i) {
    const double separation = (v.row(i) - mean).squaredNorm();
    sum += (u.col(i).array().pow(fuzziness) *
            ((points.rowwise() - v.row(i)).rowwise().squaredNorm().array() -
             separation))
               .sum();
  }
  return sum;
}

}  // namespace fdi::trainer
