// What this program says where a build was made without an optional component.
#include "base/error.h"
#include "programs/monitor/planner.h"
#include "programs/monitor/verbs.h"

namespace fdi::monitor {

#if !FDI_PLANNER
void AddGroupsOption(report::Program& program, CLI::App& /*run*/,
                     std::filesystem::path& /*groups*/) {
  program.AddLeftOut("run", "--groups", "FDI_PLANNER");
}

MakeFollower FollowCauses(const std::filesystem::path& /*groups*/,
                          const report::Context& context) {
  const std::filesystem::path usual = context.options.data_dir / "groups.toml";
  if (std::filesystem::exists(usual)) {
    context.log(
        LogLevel::kWarning,
        EventLine("groups_ignored",
                  {{"file", usual.string()},
                   {"reason", report::LeftOut("the search for common causes",
                                              "FDI_PLANNER")}}));
  }
  return {};
}

std::vector<console::Route> PlannerRoutes(
    const std::filesystem::path& /*groups*/,
    const report::Context& /*context*/) {
  const auto refuse = [](const console::Api&,
                         const httplib::Request&) -> console::Json {
    throw NotFoundError(
        report::LeftOut("what the planner adds to the page", "FDI_PLANNER"));
  };
  return {{"/api/v1/groups", refuse},
          {"/api/v1/worklist(?:\\.(?:csv|html))?", refuse},
          {"/api/v1/valves/.+/health", refuse}};
}
#endif

#if !FDI_PLANT
void AddConsoleVerb(report::Program& program) {
  program.AddLeftOut("", "console", "FDI_PLANT");
}
#endif

}  // namespace fdi::monitor
