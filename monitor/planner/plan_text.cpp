// The work list in words.
#include <algorithm>
#include <cmath>

#include "monitor/planner/work_list.h"
#include "storage/cli/text_table.h"

namespace fdi::planner {
namespace {

constexpr double kNsPerHour = 3'600e9;
constexpr double kHoursPerDay = 24.0;

// "40 min", "5 h", "3 days"
std::string SpanText(std::int64_t span_ns) {
  const double hours = std::max(0.0, static_cast<double>(span_ns)) / kNsPerHour;
  if (hours < 1.0) {
    return std::to_string(std::lround(hours * 60.0)) + " min";
  }
  if (hours < 2.0 * kHoursPerDay) {
    return std::to_string(std::lround(hours)) + " h";
  }
  return std::to_string(std::lround(hours / kHoursPerDay)) + " days";
}

std::string FaultText(const FaultReason& reason, const WorkOptions& options) {
  std::string text = reason.words.name + ": ";
  const std::int64_t now_ns = std::max(options.now_ns, reason.last_ns);
  text += reason.ended_ns
              ? "ended " + SpanText(now_ns - *reason.ended_ns) + " ago"
              : "stands for " + SpanText(now_ns - reason.detected_ns);
  text += ", severity " + std::string(SeverityName(reason.words.severity));
  if (reason.strength != 0.0) {
    text += " at strength " + cli::FormatNumber(reason.strength, 2);
  }
  if (reason.episodes > 1) {
    text += ", " + std::to_string(reason.episodes) + " episodes";
  }
  if (reason.confirmed) {
    text += ", confirmed by a label";
  } else if (reason.trust < 0.5) {
    text += ", labels called this answer wrong before";
  }
  return text;
}

}  // namespace

std::string TrendText(const TrendReason& reason) {
  const monitor::HealthLimit& limit = reason.limit;
  const std::string unit = HealthUnit(limit, reason.flow_unit);
  const std::string name =
      limit.kind == monitor::HealthLimit::Kind::kStrength
          ? FaultName(limit.fault) + " strength"
      : limit.kind == monitor::HealthLimit::Kind::kTravel ? "travel"
      : limit.kind == monitor::HealthLimit::Kind::kReversals
          ? "reversals"
          : std::string(SignalName(limit.signal));
  std::string text = name;
  if (reason.forecast.now) {
    text += " at " + cli::FormatNumber(*reason.forecast.now, 2) +
            (unit.empty() ? "" : " " + unit);
  }
  return text + ", limit " + HealthLimitText(limit) + ": " +
         ForecastText(reason.forecast);
}

std::string WhyText(const ValveWork& work, const WorkOptions& options) {
  std::string why;
  const auto add = [&why](const std::string& reason) {
    why += why.empty() ? reason : "; " + reason;
  };
  std::size_t f = 0;
  std::size_t t = 0;
  while (f < work.faults.size() || t < work.trends.size()) {
    const bool fault_next =
        t == work.trends.size() ||
        (f < work.faults.size() && WeightOf(work.faults[f], options) >=
                                       WeightOf(work.trends[t], options));
    add(fault_next ? FaultText(work.faults[f], options)
                   : TrendText(work.trends[t]));
    ++(fault_next ? f : t);
  }
  return why;
}

}  // namespace fdi::planner
