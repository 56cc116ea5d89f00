#pragma once

#include <vector>

#include "monitor/console/api.h"

namespace fdi::planner {

/// /api/v1/worklist, worklist.csv, report, report.html, valves/ID/health.
/// Reading months of all valves takes a while, so the last work list and the
/// last report stay valid for a minute.
std::vector<console::Route> ConsoleRoutes();

}  // namespace fdi::planner
