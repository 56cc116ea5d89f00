#include "trainer/consequent_estimation.h"

#include <cmath>

#include <Eigen/QR>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

// Pivots smaller than this share of the largest count as dependent columns.
constexpr double kRankTolerance = 1e-10;

// Minimum-norm least squares of `a` θ = `b`.
VectorXd Solve(const MatrixXd& a, const VectorXd& b) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition;
  decomposition.setThreshold(kRankTolerance);
  decomposition.compute(a);
  return decomposition.solve(b);
}

// Rule i alone, in standardized columns Xs. Centering on the weighted means
// takes the intercept out of the system: it is what the means leave.
void EstimateLocal(const MatrixXd& xs, const Eigen::Ref<const VectorXd>& y,
                   const Eigen::Ref<const VectorXd>& weights, double ridge,
                   Eigen::Ref<VectorXd> theta) {
  const Index n = xs.cols();
  const double total = weights.sum();
  if (!(total > 0.0)) {
    theta.setZero();
    theta(n) = y.mean();
    return;
  }
  const RowVectorXd x_mean = weights.transpose() * xs / total;
  const double y_mean = weights.dot(y) / total;
  const VectorXd root = weights.cwiseSqrt();
  const Index extra = ridge > 0.0 ? n : 0;
  MatrixXd a = MatrixXd::Zero(xs.rows() + extra, n);
  VectorXd b = VectorXd::Zero(xs.rows() + extra);
  a.topRows(xs.rows()) = root.asDiagonal() * (xs.rowwise() - x_mean);
  b.head(xs.rows()) = root.array() * (y.array() - y_mean);
  a.bottomRows(extra).diagonal().setConstant(std::sqrt(ridge * total));
  theta.head(n) = Solve(a, b);
  theta(n) = y_mean - x_mean.dot(theta.head(n));
}

// All rules at once, columns [w₁Xs w₁ w₂Xs w₂ ...].
MatrixXd EstimateGlobal(const MatrixXd& xs, const VectorXd& y,
                        const Eigen::Ref<const MatrixXd>& weights,
                        double ridge) {
  const Index n = xs.cols();
  const Index c = weights.cols();
  const Index extra = ridge > 0.0 ? n * c : 0;
  MatrixXd a = MatrixXd::Zero(xs.rows() + extra, c * (n + 1));
  VectorXd b = VectorXd::Zero(xs.rows() + extra);
  b.head(xs.rows()) = y;
  for (Index i = 0; i < c; ++i) {
    auto block = a.middleCols(i * (n + 1), n + 1);
    block.topRows(xs.rows()).leftCols(n) = weights.col(i).asDiagonal() * xs;
    block.topRows(xs.rows()).col(n) = weights.col(i);
    if (extra > 0) {
      block.block(xs.rows() + i * n, 0, n, n)
          .diagonal()
          .setConstant(std::sqrt(ridge * weights.col(i).sum()));
    }
  }
  const VectorXd theta = Solve(a, b);
  return Eigen::Map<const MatrixXd>(theta.data(), n + 1, c);
}

}  // namespace

Consequents EstimateConsequents(const Eigen::Ref<const MatrixXd>& x,
                                const Eigen::Ref<const VectorXd>& y,
                                const Eigen::Ref<const MatrixXd>& weights,
                                const ConsequentOptions& options) {
  const Index n = x.cols();
  const Index c = weights.cols();
  Require(x.rows() > 0 && x.rows() == y.size() && x.rows() == weights.rows(),
          "X, y and W need the same number of rows, at least 1");
  Require(n > 0 && c > 0, "X and W need at least one column");
  Require(options.ridge >= 0.0, "ridge must not be negative");

  const RowVectorXd mean = x.colwise().mean();
  MatrixXd xs = x.rowwise() - mean;
  RowVectorXd scale =
      (xs.colwise().squaredNorm() / static_cast<double>(x.rows())).cwiseSqrt();
  scale = (scale.array() > 0.0).select(scale, 1.0);
  xs.array().rowwise() /= scale.array();
  const double y_mean = y.mean();
  const VectorXd ys = y.array() - y_mean;

  MatrixXd theta(n + 1, c);  // Slopes of Xs, then the intercept.
  if (options.method == ConsequentMethod::kGlobal) {
    theta = EstimateGlobal(xs, ys, weights, options.ridge);
  } else {
    for (Index i = 0; i < c; ++i) {
      EstimateLocal(xs, ys, weights.col(i), options.ridge, theta.col(i));
    }
  }
  Consequents result;
  result.slopes =
      theta.topRows(n).transpose().array().rowwise() / scale.array();
  result.intercepts = theta.row(n).transpose().array() + y_mean;
  result.intercepts -= result.slopes * mean.transpose();
  return result;
}

}  // namespace fdi::trainer
