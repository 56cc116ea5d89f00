#pragma once

#include <filesystem>
#include <vector>

#include "report/json_output.h"
#include "storage/history/common_cause.h"

namespace fdi::planner {

/// Reads the groups of valves that may share a cause:
///
///     [[group]]
///     name = "air header west"
///     valves = ["FV-1*", "LV-207"]   # ids or globs
///     faults = ["f16", "f17"]        # any of them; these by default
///     min_valves = 3                 # at least this many valves (2..),
///     within_s = 300                 # within this many seconds
///
/// @throws ConfigError naming file, line and key; NotFoundError.
std::vector<storage::CauseGroup> ReadCauseGroups(
    const std::filesystem::path& path);

/// {"kind": "COMMON_CAUSE_OPENED", ..., "cause_id", "group", "stamp_utc",
/// "valves", "members": [{"valve_id", "episode_id", "fault"}]}
report::Json CauseJson(const storage::CauseChange& change);

}  // namespace fdi::planner
