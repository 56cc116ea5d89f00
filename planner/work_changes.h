#pragma once

#include <optional>
#include <string>

#include "report/json_output.h"

namespace fdi::planner {

/// The changes since the last list: for each valve, its worst row that
/// stands, and whether it was judged, compared one by one, so a valve may have
/// two changes. Worse and better are by severity; a change of confidence is
/// none. {"last_utc", "file", "valves": [{"valve_id", "change", "before",
/// "now"}], "coverage"}; null without a last one.
/// @param last, now documents of WorkList().
/// @param file where `last` is from.
/// @throws DataError if `last` is no such document: it may be a file of the
///   user that happens to have its name, which must not be replaced.
report::Json ChangesJson(const std::optional<report::Json>& last,
                         const std::string& file, const report::Json& now);

}  // namespace fdi::planner
