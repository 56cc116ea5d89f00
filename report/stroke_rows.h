#pragma once

#include <string>
#include <vector>

#include "diagnosis/loop/strokes.h"
#include "report/json_output.h"
#include "report/report.h"

namespace fdi::report {

/// {"kind": "full" or "partial", "cv_low_pct", "cv_high_pct", "x_low_pct",
/// "x_high_pct", "rising" and "falling": {"moves", "unanswered", "delay_s",
/// "t63_s", "t86_s", "overshoot_pct", "breakaway_pct", "breakaway_kpa"},
/// "signature": {"friction_kpa", "spring_kpa_per_pct", "at_0_kpa",
/// "at_100_kpa"} or null, "worse": []}
Json StrokeJson(const loop::Stroke& stroke,
                const std::vector<std::string>& worse);

/// The columns of a table of such rows, with their "start_utc". @param last_key
///   the member that is null if there was no test before.
std::vector<Column> StrokeColumns(const char* last_key);

}  // namespace fdi::report
