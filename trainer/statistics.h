#pragma once

#include <span>
#include <vector>

namespace fdi::trainer {

/// 0 of no values.
double Mean(std::span<const double> values);
/// About the mean, over N; 0 of no values.
double Variance(std::span<const double> values);
/// Over the values that are numbers; 0 if none is.
double MeanSquare(std::span<const double> values);
/// Linear between the values; `sorted` must not be empty, q in [0, 1].
double SortedQuantile(const std::vector<double>& sorted, double q);

/// Pairs that differ, by the sign of the difference.
struct SignTest {
  int positive{0};
  int negative{0};
  int ties{0};  ///< Say nothing.

  int decided() const { return positive + negative; }
};

/// So many pairs must differ before the test can fall below 5 % at all:
/// 2·2⁻⁵ > 0.05 ≥ 2·2⁻⁶.
inline constexpr int kMinDecidedPairs = 6;

/// Counts the signs of `differences`; NaN is no pair.
SignTest CountSigns(const std::vector<double>& differences);

/// The two-sided exact sign test [Dixon & Mood, 1946]: how probable signs at
/// least as uneven would be if both were equally likely,
///
///     p = min(1, 2 Σ_{i ≤ min(n₊, n₋)} C(n, i) 2⁻ⁿ),   n = n₊ + n₋,
///
/// 1 if no pair differs. For detected or not, it is McNemar's exact test.
///
/// - [Dixon & Mood, 1946] "The statistical sign test", J. Am. Stat. Assoc.
///   41(236), pp. 557–566.
double PValue(const SignTest& test);

/// Hours of a year, 365.25 days.
inline constexpr double kHoursPerYear = 8766.0;

/// Observed rate of an event, and its bound.
struct EventRate {
  double per_year{0.0};
  double upper{0.0};  ///< 95 % bound [1/year], exact for a Poisson process.
};

/// The rate of `events` in `hours`; the bound μ solves P(N ≤ events | μ) = 5 %:
/// none in T says below 3/T.
/// @throws std::invalid_argument if events < 0 or hours ≤ 0.
EventRate RateOf(int events, double hours);

}  // namespace fdi::trainer
