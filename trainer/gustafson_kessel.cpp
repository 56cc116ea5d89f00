#include "trainer/gustafson_kessel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::ArrayXXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSmallest = std::numeric_limits<double>::min();

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
  Require(points.cols() >= 1, "points need at least one column");
  Require(points.rows() > options.num_clusters,
          "points need more rows than clusters");
  Require(points.allFinite(), "points must be finite numbers");
}

// The rows of Z in lexicographic order.
std::vector<Index> LexicographicOrder(const Eigen::Ref<const MatrixXd>& z) {
  std::vector<Index> order(static_cast<std::size_t>(z.rows()));
  std::iota(order.begin(), order.end(), Index{0});
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
double LogDeterminant(const VectorXd& eigenvalues) {
  return eigenvalues.array().log().sum();
}

// One start of the alternating minimization over fixed points Z, N×n. All
// buffers are allocated once; a step works on whole columns.
class Iteration {
 public:
  Iteration(const MatrixXd& z, const GustafsonKesselOptions& options)
      : z_(z),
        options_(options),
        u_(z.rows(), options.num_clusters),
        distances_(z.rows(), options.num_clusters),
        centered_(z.rows(), z.cols()),
        weights_(z.rows()),
        scratch_(z.rows()),
        nearest_(z.rows()),
        centers_(options.num_clusters, z.cols()),
        covariances_(static_cast<std::size_t>(options.num_clusters),
                     MatrixXd(z.cols(), z.cols())) {
    PrepareRegularization();
  }

  FuzzyPartition Run(unsigned seed) {
    DrawCenters(seed);
    for (Index i = 0; i < u_.cols(); ++i) {
      centered_ = z_.rowwise() - centers_.row(i);
      distances_.col(i) = centered_.rowwise().squaredNorm();
    }
    UpdateMemberships();
    FuzzyPartition result;
    while (result.iterations < options_.max_iterations && !result.converged) {
      for (Index i = 0; i < u_.cols(); ++i) {
        UpdateCluster(i);
      }
      const double change = UpdateMemberships();
      ++result.iterations;
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
    const double mean_variance = f0.trace() / n;
    smallest_eigenvalue_ = std::max(1e-30 * mean_variance, kSmallest);
    const VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(f0, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .cwiseMax(smallest_eigenvalue_);
    spread_ =
        options_.covariance_weight * std::exp(LogDeterminant(eigenvalues) / n);
  }

  // Centers among the points, each drawn with a probability proportional to
  // the squared distance from the nearest one drawn before.
  void DrawCenters(unsigned seed) {
    std::mt19937_64 generator(seed);
    nearest_.setOnes();
    for (Index i = 0; i < centers_.rows(); ++i) {
      const double total = nearest_.sum();
      // 53 random bits; std::uniform_real_distribution differs by library.
      double left = static_cast<double>(generator() >> 11U) * 0x1p-53 * total;
      Index k = 0;
      while (k + 1 < z_.rows() && left >= nearest_(k)) {
        left -= nearest_(k);
        ++k;
      }
      centers_.row(i) = z_.row(k);
      scratch_ =
          (z_.rowwise() - centers_.row(i)).rowwise().squaredNorm().array();
      nearest_ = i == 0 ? scratch_ : nearest_.min(scratch_);
    }
  }

  // μ^m of cluster i into weights_.
  void UpdateWeights(Index i) {
    if (options_.fuzziness == 2.0) {
      weights_ = u_.col(i).square();
    } else {
      weights_ = u_.col(i).pow(options_.fuzziness);
    }
  }

  // vᵢ, Fᵢ and the distances of all points from it.
  void UpdateCluster(Index i) {
    const Index n = z_.cols();
    UpdateWeights(i);
    const double total = std::max(weights_.sum(), kSmallest);
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
    UpdateDistances(i, NormInducingFactor(f));
  }

  // Regularizes F in place and returns upper triangular R, RᵀR = A =
  // det(F)^(1/n) F⁻¹.
  MatrixXd NormInducingFactor(MatrixXd& f) const {
    f *= 1.0 - options_.covariance_weight;
    f.diagonal().array() += spread_;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(f);
    const double floor = solver.eigenvalues().maxCoeff();
    const VectorXd eigenvalues = solver.eigenvalues().cwiseMax(
        std::max(floor / options_.max_condition, smallest_eigenvalue_));
    const MatrixXd& q = solver.eigenvectors();
    f = q * eigenvalues.asDiagonal() * q.transpose();
    const double scale =
        std::exp(LogDeterminant(eigenvalues) / static_cast<double>(f.rows()));
    const VectorXd root = (scale / eigenvalues.array()).sqrt();
    return (root.asDiagonal() * q.transpose())
        .householderQr()
        .matrixQR()
        .triangularView<Eigen::Upper>();
  }

  // Dᵢₖ = ‖R (zₖ − vᵢ)‖², column by column.
  void UpdateDistances(Index i, const MatrixXd& r) {
    const Index n = z_.cols();
    for (Index a = 0; a < n; ++a) {
      scratch_ = r(a, a) * centered_.col(a).array();
      for (Index b = a + 1; b < n; ++b) {
        scratch_ += r(a, b) * centered_.col(b).array();
      }
      if (a == 0) {
        distances_.col(i) = scratch_.square();
      } else {
        distances_.col(i) += scratch_.square();
      }
    }
  }

  // U from the distances; returns max|ΔU|. A point on a center has a distance
  // of 0: the floor gives it to that center, or evenly to those it lies on.
  double UpdateMemberships() {
    distances_ = distances_.max(kSmallest);
    nearest_ = distances_.rowwise().minCoeff();
    weights_.setZero();
    // Until the sum is known, the ratios stand in for the new memberships.
    double change = 0.0;
    for (Index i = 0; i < u_.cols(); ++i) {
      weights_ += Ratio(i);
    }
    weights_ = weights_.inverse();
    for (Index i = 0; i < u_.cols(); ++i) {
      Ratio(i);
      scratch_ *= weights_;
      change = std::max(change, (scratch_ - u_.col(i)).abs().maxCoeff());
      u_.col(i) = scratch_;
    }
    return change;
  }

  // (min_j Dⱼₖ / Dᵢₖ)^(1/(m−1)) in scratch_.
  const ArrayXd& Ratio(Index i) {
    scratch_ = nearest_ / distances_.col(i);
    if (options_.fuzziness != 2.0) {
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
  double smallest_eigenvalue_{kSmallest};
};

// Whether `a` is the better of two results.
bool Better(const FuzzyPartition& a, const FuzzyPartition& b) {
  if (a.separated != b.separated) {
    return a.separated;
  }
  return a.objective < b.objective;
}

}  // namespace

FuzzyPartition FitGustafsonKessel(const Eigen::Ref<const MatrixXd>& points,
                                  const GustafsonKesselOptions& options) {
  CheckArguments(points, options);
  const std::vector<Index> order = LexicographicOrder(points);
  const MatrixXd sorted = points(order, Eigen::all);

  Iteration iteration(sorted, options);
  FuzzyPartition best = iteration.Run(options.seed);
  for (int start = 1; start < options.num_starts; ++start) {
    FuzzyPartition next =
        iteration.Run(options.seed + static_cast<unsigned>(start));
    if (Better(next, best)) {
      best = std::move(next);
    }
  }

  MatrixXd unsorted(best.memberships.rows(), best.memberships.cols());
  unsorted(order, Eigen::all) = best.memberships;
  best.memberships = std::move(unsorted);
  return best;
}

}  // namespace fdi::trainer
