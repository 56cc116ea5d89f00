#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/records/health_hour.h"
#include "planner/health_trend.h"

namespace fdi::planner {

/// A quantity followed over months, and its limit.
struct HealthLimit {
  enum class Kind : std::uint8_t {
    kResidual,   ///< Mean residual of a signal [its unit].
    kDeviation,  ///< The same, relative to what the normal model expects [%].
    kStrength,   ///< Mean estimated strength of a fault [-].
    kTravel,     ///< Full strokes, of 100 % of travel.
    kReversals,
  };
  Kind kind{Kind::kResidual};
  Signal signal{Signal::kF};
  int fault{0};
  double value{0.0};

  bool cumulative() const {
    return kind == Kind::kTravel || kind == Kind::kReversals;
  }
};

/// Parses "F=-10%", "X=3", "f19=0.5", "travel=100000", "reversals=1e6"; names
/// in any case. @throws ConfigError naming `text` and what is accepted.
HealthLimit ParseHealthLimit(std::string_view text);
/// The inverse of ParseHealthLimit().
std::string HealthLimitText(const HealthLimit& limit);
/// "m3/h", "%", "", "strokes"
std::string HealthUnit(const HealthLimit& limit, FlowUnit flow_unit);

/// Daily values of one quantity from the hours of health.
struct HealthSeries {
  std::vector<DailyValue> days;  ///< Judged days, since 1970-01-01.
  double seen_hours{0.0};
  double live_hours{0.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

/// Daily values of chronological hours from the last epoch and, except for
/// travel and reversals, from the last model set: what another valve or another
/// model reported is not comparable. A day needs one LIVE hour.
///
/// Residuals depend on the operating point of the valve. With m_db the mean of
/// day d in bin b, m_db = a_b + slope t is fitted over all bins with one common
/// slope; the value of a day is the mean of m_db − a_b, plus the mean of a_b.
/// So a change of operation does not look like drift.
HealthSeries SeriesOf(std::span<const HealthHour> hours,
                      const HealthLimit& limit);

/// The mean residuals of one signal hour by hour, likewise comparable.
struct HourlyResiduals {
  std::vector<DailyValue> hours;  ///< `day` counts hours since 1970-01-01.
  double deviation{0.0};  ///< Single residuals' deviation in hour and bin.
};

/// An hour needs a quarter of it LIVE.
HourlyResiduals HourlyResidualsOf(std::span<const HealthHour> hours,
                                  Signal signal);

/// When a limit will be reached.
struct HealthForecast {
  enum class Answer : std::uint8_t {
    kTime,     ///< `time` is set.
    kReached,  ///< At or beyond the limit now.
    kAway,     ///< A significant trend, but not towards the limit.
    kNoTrend,  ///< No significant trend (two-sided test at 5 %).
    kOutside,  ///< Mostly outside what was trained: less than one LIVE hour
               ///< in five.
    kTooFew,   ///< Fewer than kTrendDays days.
  };
  Answer answer{Answer::kTooFew};
  int days{0};                  ///< Number of days used,
  double first_day{0.0};        ///< the first
  double last_day{0.0};         ///< and the last of them.
  std::optional<double> now;    ///< Level on the last day, or the total.
  std::optional<double> slope;  ///< [1/day]
  std::optional<TimeToLimit> time;
};

HealthForecast Forecast(const HealthSeries& series, const HealthLimit& limit);

/// "limit in 40 days (90 %: 31..58)", "no significant trend", ...
std::string ForecastText(const HealthForecast& forecast);
/// "time", "reached", "away", "no_trend", "outside", "too_few"
std::string_view AnswerName(HealthForecast::Answer answer);

}  // namespace fdi::planner
