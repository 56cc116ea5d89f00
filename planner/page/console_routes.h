#pragma once

#include <vector>

#include "console/api.h"
#include "storage/history/common_cause.h"

namespace fdi::planner {

/// /api/v1/groups, worklist, worklist.csv, report, report.html,
/// valves/ID/health.
/// Reading months of all valves takes a while, so the last work list and the
/// last report stay valid for a minute.
/// @param groups of valves, which the page shows as such.
std::vector<console::Route> ConsoleRoutes(
    const std::vector<storage::CauseGroup>& groups = {});

}  // namespace fdi::planner
