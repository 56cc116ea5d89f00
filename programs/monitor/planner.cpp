#include "programs/monitor/planner.h"

#include <CLI/CLI.hpp>

#include "planner/live/cause_groups.h"
#include "planner/live/cause_watch.h"
#include "planner/live/console_routes.h"

namespace fdi::monitor {
namespace {

// None without a file.
std::vector<storage::CauseGroup> ReadGroups(const std::filesystem::path& groups,
                                            const report::Context& context) {
  const std::filesystem::path usual = context.options.data_dir / "groups.toml";
  if (groups.empty() && !std::filesystem::exists(usual)) {
    return {};
  }
  return planner::ReadCauseGroups(groups.empty() ? usual : groups);
}

}  // namespace

void AddGroupsOption(report::Program& /*program*/, CLI::App& run,
                     std::filesystem::path& groups) {
  run.add_option("--groups", groups,
                 "Groups of valves, [[group]] name, valves, faults, "
                 "min_valves, within_s: faults that many have at once get one "
                 "common cause (default: DATA/groups.toml)")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.toml");
}

MakeFollower FollowCauses(const std::filesystem::path& groups,
                          const report::Context& context) {
  std::vector<storage::CauseGroup> read = ReadGroups(groups, context);
  return read.empty() ? MakeFollower{}
                      : planner::CauseFollower(std::move(read));
}

std::vector<console::Route> PlannerRoutes(const std::filesystem::path& groups,
                                          const report::Context& context) {
  return planner::ConsoleRoutes(ReadGroups(groups, context));
}

}  // namespace fdi::monitor
