#pragma once

#include <span>

namespace fdi::trainer {

/// A threshold from the upper tail of a series, and what it rests on.
struct TailThreshold {
  double level{0.0};  ///< Exceeded at the stated rate [unit of data].
  double base{0.0};   ///< u, where the tail begins.
  double scale{0.0};  ///< σ of the generalized Pareto distribution.
  double shape{0.0};  ///< ξ; negative: bounded tail.
  int clusters{0};    ///< Independent exceedances of u.
};

/// The level that a stationary series exceeds `rate` times per sample, by
/// peaks over threshold: above u, the 95 % quantile, cluster maxima follow
///
///     P(z > u + y) = (1 + ξ y/σ)^(−1/ξ),
///
/// fitted by probability-weighted moments [Hosking & Wallis, 1987]; ξ is
/// shrunk towards 0, the exponential tail, with n/(n + 50) for n clusters and
/// kept within [-0.1, 0.3] (-0.1 is what a Gaussian shows between its 95 %
/// quantile and 1e-7); σ is taken at its 95 % upper bound, mean excess times
/// 1 + 1.645/√n. The level is at least σ beyond the largest value. Exceedances
/// less than `separation` samples apart are one cluster.
///
/// @param series in its order of time; at least 100 values.
/// @param rate in (0, 0.01] [1/sample].
/// @throws std::invalid_argument if an argument is out of its range.
///
/// - [Hosking & Wallis, 1987] "Parameter and quantile estimation for the
///   generalized Pareto distribution", Technometrics 29(3), pp. 339–349.
TailThreshold FitTail(std::span<const double> series, double rate,
                      int separation);

}  // namespace fdi::trainer
