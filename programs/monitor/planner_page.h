#pragma once

#include <filesystem>
#include <vector>

#include "console/api.h"
#include "report/program.h"

namespace fdi::monitor {

/// What the planner adds to the page, or left_out.cpp if the build has no
/// planner. `groups` as for FollowCauses().
std::vector<console::Route> PlannerRoutes(const std::filesystem::path& groups,
                                          const report::Context& context);

}  // namespace fdi::monitor
