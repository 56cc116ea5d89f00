#pragma once

#include <span>

namespace fdi {

/// Generalized Pareto distribution of what is in excess of a level:
/// P(z > y) = (1 + ξ y/σ)^(−1/ξ).
struct ParetoTail {
  double scale{0.0};  ///< σ [unit of the excesses], > 0.
  double shape{0.0};  ///< ξ; 0: exponential.

  /// P(z > y) for y ≥ 0; 0 beyond the end of a bounded tail.
  double Beyond(double y) const;
};

/// Fits by probability-weighted moments. ξ is shrunk towards 0 with n/(n + 50)
/// for n excesses and kept within [least_shape, 0.3]; σ is taken at its 95 %
/// upper bound, mean excess times 1 + 1.645/√n.
///
/// @param excesses independent, ascending, at least one.
///
/// - [Hosking & Wallis, 1987] "Parameter and quantile estimation for the
///   generalized Pareto distribution", Technometrics 29(3), pp. 339–349.
ParetoTail FitPareto(std::span<const double> excesses, double least_shape);

/// The mean of a Poisson distribution that gives at most so many events with a
/// probability of 5 %: the one-sided 95 % bound of what was counted.
double PoissonBound(int events);

/// The one-sided 95 % bound of a probability of which `successes` of `trials`
/// tell [Wilson, 1927]; 1 without trials.
///
/// - [Wilson, 1927] "Probable inference, the law of succession, and statistical
///   inference", J. Am. Stat. Assoc. 22(158), pp. 209–212.
double ProbabilityBound(double successes, double trials);

/// P(N ≥ events) of a Poisson distribution of mean μ > 0.
double PoissonAtLeast(int events, double mean);

}  // namespace fdi
