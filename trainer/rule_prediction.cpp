#include "trainer/rule_prediction.h"

#include <cmath>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// log μ of one set for a whole column; -0.5 z², z = 0 in the core.
ArrayXd LogMembership(const FuzzySet& set, const ArrayXd& x) {
  const ArrayXd z = ((set.left_center - x) / set.left_width)
                        .max((x - set.right_center) / set.right_width)
                        .max(0.0);
  return -0.5 * z.square();
}

// ‖L (x − v)‖² for every row of X; 0 for a rule without a center.
ArrayXd SquaredDistance(const TsRule& rule,
                        const Eigen::Ref<const MatrixXd>& x) {
  ArrayXd squares = ArrayXd::Zero(x.rows());
  std::size_t entry = 0;
  for (std::size_t row = 0; row < rule.center.size(); ++row) {
    ArrayXd z = ArrayXd::Zero(x.rows());
    for (std::size_t j = 0; j <= row; ++j, ++entry) {
      if (rule.metric[entry] != 0.0) {
        z += rule.metric[entry] *
             (x.col(static_cast<Index>(j)).array() - rule.center[j]);
      }
    }
    squares += z.square();
  }
  return squares;
}

}  // namespace

MatrixXd DegreesOfFulfilment(const std::vector<TsRule>& rules,
                             const Eigen::Ref<const MatrixXd>& x) {
  Require(!rules.empty(), "there must be at least one rule");
  Eigen::ArrayXXd exponents(x.rows(), static_cast<Index>(rules.size()));
  Index i = 0;
  for (const TsRule& rule : rules) {
    Require(static_cast<Index>(rule.antecedents.size()) == x.cols(),
            "rules need one set per column of X");
    exponents.col(i) = -0.5 * SquaredDistance(rule, x);
    for (Index j = 0; j < x.cols(); ++j) {
      const FuzzySet& set = rule.antecedents[static_cast<std::size_t>(j)];
      if (std::isfinite(set.left_width) || std::isfinite(set.right_width)) {
        exponents.col(i) += LogMembership(set, x.col(j).array());
      }
    }
    ++i;
  }
  const ArrayXd largest = exponents.rowwise().maxCoeff();
  exponents = (exponents.colwise() - largest).exp();
  const ArrayXd sum = exponents.rowwise().sum();
  return exponents.colwise() / sum;
}

VectorXd Predict(const std::vector<TsRule>& rules,
                 const Eigen::Ref<const MatrixXd>& x) {
  return Predict(rules, x, DegreesOfFulfilment(rules, x));
}

VectorXd Predict(const std::vector<TsRule>& rules,
                 const Eigen::Ref<const MatrixXd>& x,
                 const Eigen::Ref<const MatrixXd>& weights) {
  VectorXd y = VectorXd::Zero(x.rows());
  for (std::size_t i = 0; i < rules.size(); ++i) {
    const Eigen::Map<const VectorXd> slopes(rules[i].slopes.data(), x.cols());
    const VectorXd output = (x * slopes).array() + rules[i].intercept;
    y += weights.col(static_cast<Index>(i)).cwiseProduct(output);
  }
  return y;
}

}  // namespace fdi::trainer
