#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "planner/health_view.h"
#include "planner/work_list.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// A finding, and what its valve is like.
struct WorkRow {
  findings::Finding finding;
  std::string why;  ///< One sentence.
  std::optional<LimitTrend> trend{};
  std::string shares{};  ///< "cause: air west", "period: 42 s"
};

/// The life of a valve since it was last replaced or repaired (its epoch).
struct ValveLife {
  double travel_strokes{0.0};
  double service_hours{0.0};
  double live_share{1.0};   ///< Share of that time that could be judged.
  std::int64_t last_ns{0};  ///< Its newest hour.
};

/// The rows, ranked by findings::IsWorse(): the faults of a valve, each once
/// with all its episodes; limits that a trend has reached or will reach within
/// the horizon (high; confidence 1 - days / horizon); drifts and figures beyond
/// their limit (low); verdicts of audits (confidence 0.9 if sure, else 0.5).
/// Episodes that a label calls false, and those that are shelved, are left out.
/// @param history null: there is none yet.
/// @param[out] lives of the valves that have hours of health.
/// @throws ConfigError for an unknown discipline, naming the accepted ones.
std::vector<WorkRow> ReadRows(storage::History* history,
                              const report::FaultTexts& texts,
                              const WorkQuery& query,
                              const findings::RankFacts& facts,
                              std::map<std::string, ValveLife>& lives);

}  // namespace fdi::planner
