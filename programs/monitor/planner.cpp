#include "programs/monitor/planner.h"

#include <CLI/CLI.hpp>

#include "planner/live/cause_groups.h"
#include "planner/live/cause_watch.h"

namespace fdi::monitor {

std::vector<storage::CauseGroup> ReadGroups(const std::filesystem::path& groups,
                                            const report::Context& context) {
  const std::filesystem::path usual = context.options.data_dir / "groups.toml";
  if (groups.empty() && !std::filesystem::exists(usual)) {
    return {};
  }
  return planner::ReadCauseGroups(groups.empty() ? usual : groups);
}

void AddGroupsOption(report::Program& /*program*/, CLI::App& run,
                     std::filesystem::path& groups) {
  run.add_option("--groups", groups,
                 "Groups of valves, [[group]] name, valves, faults, "
                 "min_valves, within_s: faults that many have at once get one "
                 "common cause (default: DATA/groups.toml)")
      ->check(CLI::ExistingFile)
      ->type_name("FILE.toml");
}

std::shared_ptr<ServicePart> FollowCauses(const std::filesystem::path& groups,
                                          const report::Context& context) {
  return planner::CausePart(ReadGroups(groups, context));
}

}  // namespace fdi::monitor
