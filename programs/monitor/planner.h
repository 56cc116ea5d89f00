#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "monitor/service/service_part.h"
#include "report/program.h"
#include "storage/history/common_cause.h"

/// The planner's additions to the verbs of this program, or left_out.cpp if the
/// build has no planner.
namespace fdi::monitor {

/// --groups of `run`.
void AddGroupsOption(report::Program& program, CLI::App& run,
                     std::filesystem::path& groups);

/// The groups of valves of a file; none without one.
/// @param groups empty: DATA/groups.toml if it exists.
/// @throws ConfigError naming file, line and key; NotFoundError.
std::vector<storage::CauseGroup> ReadGroups(const std::filesystem::path& groups,
                                            const report::Context& context);

/// Looks for common causes in the groups of ReadGroups(); null if there are
/// none.
std::shared_ptr<ServicePart> FollowCauses(const std::filesystem::path& groups,
                                          const report::Context& context);

}  // namespace fdi::monitor
