#pragma once

#include <optional>
#include <span>

namespace fdi::planner {

/// The value of one day.
struct DailyValue {
  double day{0.0};  ///< Since an arbitrary origin.
  double value{0.0};
};

/// A straight line through daily values, y(t) = level + slope (t − middle),
/// with the variances of both, which are independent.
///
/// It is a Huber M-estimate (k = 1.345, scale from the median absolute
/// deviation), so a few outlying days do not tilt it. Days are not independent:
/// with ρ the correlation of the residuals of neighbouring days, corrected for
/// the bias caused by fitting the line, n days are worth
///
///     n_e = n (1 − ρ) / (1 + ρ)
///
/// independent ones. Variances grow by n / n_e, and quantiles are those of
/// Student's t with n_e − 2 degrees of freedom.
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
  /// Two-sided test of the slope at the 5 % level.
  bool significant() const;
};

/// Minimum number of days for a fit.
inline constexpr int kTrendDays = 8;

/// Nothing if there are fewer than kTrendDays values, or all are of one day.
std::optional<TrendLine> FitTrend(std::span<const DailyValue> values);

/// When a line reaches a limit, in days after `from`; at least 0.
struct TimeToLimit {
  double days{0.0};
  double lower{0.0};  ///< Ends of a 90 % interval, by Fieller's theorem.
  double upper{0.0};
};

/// Nothing if the slope is not significant, or leads away from the limit.
/// Zero if the limit has been passed by `from`.
std::optional<TimeToLimit> ToLimit(const TrendLine& line, double limit,
                                   double from);

/// When a total that grows by `values` a day on average has grown by
/// `remaining`, with a 90 % interval as above; `upper` may be infinite. Nothing
/// if it does not grow, or with fewer than kTrendDays values.
std::optional<TimeToLimit> ToTotal(std::span<const DailyValue> values,
                                   double remaining);

}  // namespace fdi::planner
