#pragma once

#include <optional>
#include <span>

namespace fdi::monitor {

/// A value of one day.
struct DailyValue {
  double day{0.0};  ///< Since any fixed day.
  double value{0.0};
};

/// A straight line through daily values, y(t) = level + slope (t − middle),
/// with the variances of both, which are independent.
///
/// It is a Huber M-estimate (k = 1.345, scale by the median absolute
/// deviation): a few odd days do not turn it. Days are not independent: with ρ
/// the correlation of residuals of neighbouring days, corrected for the bias
/// that fitting a line brings, n days tell as much as
///
///     n_e = n (1 − ρ) / (1 + ρ)
///
/// independent ones. Variances are larger by n / n_e, and quantiles are those
/// of Student's t with n_e − 2 degrees of freedom.
struct TrendLine {
  double middle{0.0};  ///< Mean of the days.
  double level{0.0};   ///< [unit]
  double slope{0.0};   ///< [unit/day]
  double level_variance{0.0};
  double slope_variance{0.0};
  double correlation{0.0};  ///< ρ
  double freedom{0.0};      ///< n_e − 2, at least 1.
  int days{0};
  double first_day{0.0};
  double last_day{0.0};

  double At(double day) const { return level + slope * (day - middle); }
  /// Two-sided test of the slope at 5 %.
  bool significant() const;
};

/// The least days that a line is drawn through.
inline constexpr int kTrendDays = 8;

/// Nothing if there are fewer than kTrendDays values, or all of one day.
std::optional<TrendLine> FitTrend(std::span<const DailyValue> values);

/// When a line meets a limit, in days after `from`; at least 0.
struct TimeToLimit {
  double days{0.0};
  double lower{0.0};  ///< Of a 90 % interval, by Fieller's theorem.
  double upper{0.0};
};

/// Nothing if the slope is not significant, or leads away from the limit.
/// Zero where the limit is passed at `from`.
std::optional<TimeToLimit> ToLimit(const TrendLine& line, double limit,
                                   double from);

/// When a sum that grows by `values` a day on average has grown by
/// `remaining`, with a 90 % interval as above; `upper` may be infinite.
/// Nothing if it does not grow, or there are fewer than kTrendDays values.
std::optional<TimeToLimit> ToTotal(std::span<const DailyValue> values,
                                   double remaining);

}  // namespace fdi::monitor
