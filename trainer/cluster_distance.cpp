#include "trainer/cluster_distance.h"

#include <limits>

#include <Eigen/Cholesky>

#include "diagnosis/error.h"

namespace fdi::trainer {

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

}  // namespace fdi::trainer
