#pragma once

#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "monitor/planner/work_list.h"
#include "storage/cli/json_output.h"

namespace fdi::planner {

/// {"rows": [{"rank", "valve", "score", "why", "fault", "name", "discipline",
/// "namur", "severity", "check", "strength", "open", "episodes", "episode",
/// "detected_ms", "confirmed", "trends": [Forecast], "travel_strokes",
/// "service_hours", "live_share", "last_ms"}]}; null where there is none, fault
/// .. confirmed of the weightiest fault.
cli::Json WorkListJson(std::span<const WorkRow> rows);

/// The same as CSV, RFC 4180, a line each with a header.
void WriteWorkListCsv(std::ostream& out, std::span<const WorkRow> rows);

/// {"limit", "unit", "answer", "text", "now", "per_day", "days", "lower_days",
/// "upper_days", "from_day", "to_day", "rests_on_days"}
cli::Json ForecastJson(const TrendReason& reason);

/// Hours of one valve: {"hours": [{"hour_ms", "epoch", "model_hash", "seen_h",
/// "live_h", "alarm_h", "open_h", "shut_h", "d0", "travel_strokes",
/// "reversals", "channels": [{"signal", "unit", "mean", "rms", "percent",
/// "bins": [{"cv_from", "cv_to", "samples", "mean", "rms"}]}], "strengths":
/// [{"fault", "strength", "samples"}]}]}
cli::Json HealthHoursJson(std::span<const HealthHour> hours);

/// Hours of one valve as CSV: a line per hour and channel.
void WriteHealthCsv(std::ostream& out, std::span<const HealthHour> hours);

/// The hours of each day as one, with all model sets and epochs apart.
std::vector<HealthHour> DaysOf(std::span<const HealthHour> hours);

/// Mean and rms of all bins of channel `c`, and its mean in % of what is
/// expected; NaN where nothing was judged.
struct ChannelFigures {
  double mean;
  double rms;
  double percent;
  std::int64_t samples;
};
ChannelFigures FiguresOf(const HealthHour& hour, std::size_t c);
double NormalFactorOf(const HealthHour& hour);

}  // namespace fdi::planner
