#pragma once

#include <vector>

#include "console/api.h"
#include "storage/history/common_cause.h"

namespace fdi::planner {

/// /api/v1/groups, worklist, worklist.csv, worklist.html, valves/ID/health.
/// Reading months of all valves takes a while, so the last work list stays
/// valid for a minute; it says as of when it is.
/// @param groups of valves, which the page shows as groups.
std::vector<console::Route> ConsoleRoutes(
    const std::vector<storage::CauseGroup>& groups = {});

}  // namespace fdi::planner
