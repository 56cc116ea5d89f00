#pragma once

#include <Eigen/Core>

namespace fdi::trainer {

enum class ConsequentMethod {
  kLocal,  ///< Each rule on its own: readable, robust; the default.
  kGlobal  ///< All rules at once: lower error, worse conditioning.
};

struct ConsequentOptions {
  ConsequentMethod method{ConsequentMethod::kLocal};
  double ridge{0.0};  ///< ≥ 0, on the slopes of standardized columns [-].
};

/// y_i = a_iᵀ x + b_i of every rule.
struct Consequents {
  Eigen::MatrixXd slopes;      ///< a, c×n.
  Eigen::VectorXd intercepts;  ///< b, c.
};

/// Estimates the consequents of c rules.
///
/// Local: for each rule i the minimizer of Σₖ wₖᵢ (yₖ − a_iᵀ xₖ − b_i)².
/// Global: the minimizer of Σₖ (yₖ − Σᵢ wₖᵢ (a_iᵀ xₖ + b_i))².
/// Both are solved by a column-pivoted orthogonal decomposition of the
/// standardized (sqrt-)weighted system, never by the normal equations; where
/// it is rank deficient the smallest slopes are taken. A ridge adds
/// `ridge` × (sum of weights) × Σ (standardized slope)².
///
/// @param x X, N×n.
/// @param y N targets.
/// @param weights W, N×c, ≥ 0: the normalized degrees of fulfilment
///   βₖᵢ / Σⱼ βₖⱼ; each row sums to 1 for the global method.
/// @throws std::invalid_argument if the sizes do not match or are 0, or if
///   ridge is negative.
Consequents EstimateConsequents(
    const Eigen::Ref<const Eigen::MatrixXd>& x,
    const Eigen::Ref<const Eigen::VectorXd>& y,
    const Eigen::Ref<const Eigen::MatrixXd>& weights,
    const ConsequentOptions& options = {});

}  // namespace fdi::trainer
