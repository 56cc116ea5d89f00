#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sustained.h"

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
/// fitted by FitPareto() with ξ ≥ −0.1, which is what a Gaussian shows between
/// its 95 % quantile and 1e-7. The level is at least σ beyond the largest
/// value. Exceedances less than `separation` samples apart are one cluster.
///
/// @param series in its order of time; at least 100 values.
/// @param rate in (0, 0.01] [1/sample].
/// @throws std::invalid_argument if an argument is out of its range.
TailThreshold FitTail(std::span<const double> series, double rate,
                      int separation);

/// MSE, VAF = 100 (1 − var(r)/var(y)) and bias of residuals r against the
/// outputs y they belong to. @throws std::invalid_argument if sizes differ.
ValidationFigures Figures(std::span<const double> residuals,
                          std::span<const double> outputs);

/// The membership of an observer's residual from residuals under its own
/// condition: core from the 5 % to the 95 % quantile, stretched to hold zero;
/// support beyond the extremes by one standard deviation.
Trapezoid FitMembership(std::span<const double> residuals);

/// τ = 1 + 2 Σ ρ_j up to the first autocorrelation below 0.05 [samples].
double CorrelationTime(std::span<const double> residuals);

/// Residuals of one channel, one series per stretch of time.
using ResidualSeries = std::vector<std::vector<double>>;

/// All series one after another.
std::vector<double> Joined(const ResidualSeries& series);

/// Amount that the slow part of a residual may add on another day, beyond what
/// its hours show: the bound that a new day's mean exceeds with probability
/// `share`,
///
///     t_ν(1 − share) s √(1 + 1/n),   s² = (ν₀ (κσ)² + Σ (m_i − m̄)²)/ν,
///     ν = ν₀ + n − 1,
///
/// from the means m_i of n blocks of about `block` samples, and a prior of ν₀ =
/// 4 days on which the mean strayed by κ deviations: 0.2 of an output, 1 of an
/// input (T1, P1, P2), which goes where the plant goes. With hours it narrows.
double SlowAllowance(const ResidualSeries& residuals, std::size_t block,
                     double kappa, double share);

/// Thresholds of the normal residual per channel, and limits of its windows,
/// for `rate` false alarms per hour over all tests together: each channel has
/// two for the n_d consecutive samples that a detection takes, and three for
/// each window, of which the energy is watched upwards only (peaks over
/// threshold, see FitTail()). A window that the series are too short for gets
/// no limits. Thresholds and limits on means have room for another day
/// (SlowAllowance(), a day's share of the rate).
///
/// The limit on the energy follows the activity of CV (WindowLimits): the slope
/// is that of the line through the log-deviations of residual and command over
/// the windows, the activity of the training their median; the tail is fitted
/// to what is left above the line.
///
/// @param residuals by channel.
/// @param windows lengths N by channel [samples].
/// @param commands CV at the samples of the residuals; empty: no slopes.
/// @throws ConfigError if `rate_per_hour` is above 0.01 per sample and test,
///   DataError naming the channel if it has fewer than 100 residuals.
void FitThresholds(const std::vector<ResidualSeries>& residuals,
                   const std::vector<std::vector<int>>& windows,
                   double rate_per_hour, ModelSet& models,
                   const std::vector<ResidualSeries>& commands = {});

/// Less than this is thin: a record, or the readings of a signal in it [min].
inline constexpr double kLeastMinutes = 25.0;

/// Gives both thresholds of a channel the wider of the two if it runs on its
/// own past, or has thin readings: such a model errs after a large move of the
/// command, one way or the other, and some hours, or a few readings, may hold
/// the largest errors of one way alone.
///
/// @param residuals by channel, as for FitThresholds().
void BalanceThresholds(const std::vector<ResidualSeries>& residuals,
                       ModelSet& models);

}  // namespace fdi::trainer
