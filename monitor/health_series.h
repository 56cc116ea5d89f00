#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/health_hour.h"
#include "monitor/health_trend.h"

namespace fdi::monitor {

/// What is followed over months, and how far it may go.
struct HealthLimit {
  enum class Kind : std::uint8_t {
    kResidual,   ///< Mean residual of a signal [its unit].
    kDeviation,  ///< Likewise, of what the normal model expects [%].
    kStrength,   ///< Mean estimated strength of a fault [-].
    kTravel,     ///< Strokes, of 100 % of travel each.
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

/// "F=-10%", "X=3", "f19=0.5", "travel=100000", "reversals=1e6"; names in any
/// case. @throws ConfigError naming `text` and what is accepted.
HealthLimit ParseHealthLimit(std::string_view text);
/// The same backwards.
std::string HealthLimitText(const HealthLimit& limit);
/// "m3/h", "%", "", "strokes"
std::string HealthUnit(const HealthLimit& limit, FlowUnit flow_unit);

/// What the hours say about one quantity.
struct HealthSeries {
  std::vector<DailyValue> days;  ///< Days since 1970-01-01 that were judged.
  double seen_hours{0.0};
  double live_hours{0.0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

/// Daily values of hours in order of time, of the epoch that came last, and,
/// but for travel and reversals, of the model set that came last: what another
/// valve or another model said does not compare. A day needs one LIVE hour.
///
/// Residuals depend on where the valve works. With m_db the mean of day d in
/// bin b, m_db = a_b + slope t is fitted over all bins with one slope, and the
/// value of a day is the mean of m_db − a_b, plus the mean of a_b: a change of
/// operation is no drift.
HealthSeries SeriesOf(std::span<const HealthHour> hours,
                      const HealthLimit& limit);

/// How long until a limit is met.
struct HealthForecast {
  enum class Answer : std::uint8_t {
    kTime,     ///< `time` holds.
    kReached,  ///< It is at or beyond the limit now.
    kAway,     ///< A significant trend, but not towards the limit.
    kNoTrend,  ///< No significant trend (two-sided test at 5 %).
    kOutside,  ///< Mostly outside what was trained: less than one LIVE hour
               ///< in five.
    kTooFew,   ///< Fewer than kTrendDays days.
  };
  Answer answer{Answer::kTooFew};
  int days{0};                  ///< Days it rests on,
  double first_day{0.0};        ///< from
  double last_day{0.0};         ///< to.
  std::optional<double> now;    ///< Level on the last day, or the total.
  std::optional<double> slope;  ///< [1/day]
  std::optional<TimeToLimit> time;
};

HealthForecast Forecast(const HealthSeries& series, const HealthLimit& limit);

/// "limit in 40 days (90 %: 31..58)", "no significant trend", ...
std::string ForecastText(const HealthForecast& forecast);
/// "time", "reached", "away", "no_trend", "outside", "too_few"
std::string_view AnswerName(HealthForecast::Answer answer);

}  // namespace fdi::monitor
