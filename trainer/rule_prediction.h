#pragma once

#include <vector>

#include <Eigen/Core>

#include "diagnosis/ts_model.h"

namespace fdi::trainer {

/// Normalized degrees of fulfilment βₖᵢ / Σⱼ βₖⱼ; N×c, each row sums to 1.
/// The exponents are summed first, so far from all rules the nearest wins.
/// @param x X, N×n: one column per regressor of the rules.
/// @throws std::invalid_argument if there is no rule or the sizes differ.
Eigen::MatrixXd DegreesOfFulfilment(const std::vector<TsRule>& rules,
                                    const Eigen::Ref<const Eigen::MatrixXd>& x);

/// ŷ of the rules for every row of X, without the limits of a TsModel.
Eigen::VectorXd Predict(const std::vector<TsRule>& rules,
                        const Eigen::Ref<const Eigen::MatrixXd>& x);

/// ŷ of the rules for rows of X with known degrees of fulfilment W, N×c.
Eigen::VectorXd Predict(const std::vector<TsRule>& rules,
                        const Eigen::Ref<const Eigen::MatrixXd>& x,
                        const Eigen::Ref<const Eigen::MatrixXd>& weights);

}  // namespace fdi::trainer
