#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "planner/health_view.h"
#include "planner/work_costs.h"
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
  /// It was done then, and has come back or stands still.
  std::optional<std::int64_t> done_ns{};
  /// The newest order for its valve, if nothing was done since.
  std::optional<Repair> in_work{};
  std::optional<Waiting> waiting{};
  std::optional<StopAnswer> stop{};  ///< If the query asks, and it stands.
  std::uint64_t episode{0};  ///< Episode::id of the newest; 0: of no episode.
};

/// A finding that is done, and has not come back.
struct DoneFinding {
  std::string valve_id;
  std::optional<std::string> fault{};
  std::string name;
  Repair by;
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
/// their limit (low); verdicts of audits, which join the fault of the same
/// time. Episodes that a label calls false, and those that are shelved, are
/// left out. So is what is over and was labelled, or was repaired since: it is
/// `done` until it comes back.
/// @param history null: there is none yet.
/// @param[out] lives of the valves that have hours of health.
/// @param[out] done the newest first.
/// @throws ConfigError for an unknown discipline, naming the accepted ones.
std::vector<WorkRow> ReadRows(storage::History* history,
                              const report::FaultTexts& texts,
                              const WorkQuery& query,
                              const findings::RankFacts& facts,
                              std::map<std::string, ValveLife>& lives,
                              std::vector<DoneFinding>& done);

}  // namespace fdi::planner
