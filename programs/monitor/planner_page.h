#pragma once

#include <filesystem>
#include <vector>

#include "console/api.h"
#include "report/program.h"

namespace fdi::monitor {

/// The planner's routes of the page; left_out.cpp stands in for them if the
/// build has no planner. `groups` as for FollowCauses().
std::vector<console::Route> PlannerRoutes(const std::filesystem::path& groups,
                                          const report::Context& context);

}  // namespace fdi::monitor
