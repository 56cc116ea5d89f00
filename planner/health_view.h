#pragma once

#include <span>
#include <string>
#include <vector>

#include "planner/health_series.h"
#include "report/fault_texts.h"
#include "report/json_output.h"

namespace fdi::planner {

/// The forecast for one limit.
struct LimitTrend {
  HealthLimit limit;
  HealthForecast forecast;
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
};

/// Limits of −10 % and +10 % of the flow that the normal model expects.
std::vector<HealthLimit> DefaultLimits();

/// Parses each of `texts`; without any, DefaultLimits(). @throws ConfigError
std::vector<HealthLimit> ParseLimits(const std::vector<std::string>& texts);

/// The hours of one valve against each of `limits`.
std::vector<LimitTrend> TrendsOf(std::span<const HealthHour> hours,
                                 const std::vector<HealthLimit>& limits);

/// [{"limit", "unit", "answer", "text", "now", "per_day", "days",
/// "lower_days", "upper_days", "from_day", "to_day", "rests_on_days"}]
report::Json TrendsJson(std::span<const LimitTrend> trends);

/// Hours of one valve: [{"hour_utc", "epoch", "model_hash", "seen_h",
/// "live_h", "alarm_h", "auto_h", "open_h", "shut_h", "d0", "travel_strokes",
/// "path_strokes", "reversals", "slip_jumps", "turns", "steps", "at_limit",
/// "slip_jump", ... (loop::Figure), "exceeded": [figures beyond a limit of
/// `texts`], "status": "good" or the gravest class in NAMUR NE 107 of these and
/// of the faults isolated, "channels": [{"signal", "unit", "mean", "rms",
/// "percent", "bins": [{"cv_from", "cv_to", "samples", "mean", "rms"}]}],
/// "strengths":
/// [{"fault", "strength", "samples"}]}]. `percent` is the mean in % of what the
/// normal model expects. Null where nothing was judged. Hours of the plant's
/// history also have "host" and "monitor".
report::Json HealthHoursJson(std::span<const HealthHour> hours,
                             const report::FaultTexts& texts);

/// Merges the hours of each day, separately for each model set and epoch.
std::vector<HealthHour> DaysOf(std::span<const HealthHour> hours);

/// `value` with six significant digits; null if it is not finite.
report::Json SixDigits(double value);

}  // namespace fdi::planner
