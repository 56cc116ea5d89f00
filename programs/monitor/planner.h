#pragma once

#include <filesystem>
#include <vector>

#include "monitor/console/api.h"
#include "monitor/service/history_follower.h"
#include "report/program.h"

/// What the planner adds to the verbs of this program, or left_out.cpp if the
/// build has no planner.
namespace fdi::monitor {

/// --groups of `run`.
void AddGroupsOption(report::Program& program, CLI::App& run,
                     std::filesystem::path& groups);

/// Looks for common causes in the groups of valves of a file.
/// @param groups empty: DATA/groups.toml if it exists.
/// @throws ConfigError naming file, line and key; NotFoundError.
MakeFollower FollowCauses(const std::filesystem::path& groups,
                          const report::Context& context);

/// Further routes of the console. `groups` as for FollowCauses().
std::vector<console::Route> PlannerRoutes(const std::filesystem::path& groups,
                                          const report::Context& context);

}  // namespace fdi::monitor
