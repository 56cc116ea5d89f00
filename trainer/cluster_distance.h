#pragma once

#include <vector>

#include <Eigen/Core>

#include "diagnosis/ts_model.h"

namespace fdi::trainer {

/// Makes the distance to a cluster in the space of its antecedents,
///
///     log β(x) = −½ (x − v)ᵀ F⁻¹ (x − v) = −½ ‖L (x − v)‖²,   F⁻¹ = LᵀL,
///
/// the premise of a rule: fills center and metric and sets every antecedent to
/// 1 everywhere.
///
/// @param columns m regressors among those of the rule, ascending.
/// @param center v, m; in the units of the regressors.
/// @param covariance F, m×m, s.p.d.
/// @param num_regressors n ≥ m, of the rule.
/// @throws std::invalid_argument if sizes differ or F is not s.p.d.
void PlaceByDistance(const std::vector<Eigen::Index>& columns,
                     const Eigen::Ref<const Eigen::VectorXd>& center,
                     const Eigen::Ref<const Eigen::MatrixXd>& covariance,
                     Eigen::Index num_regressors, TsRule& rule);

}  // namespace fdi::trainer
