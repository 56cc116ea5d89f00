// The replies of this program in a build without an optional component.
#include "base/error.h"
#include "programs/monitor/console.h"
#include "programs/monitor/planner.h"
#include "programs/monitor/verbs.h"
#if FDI_CONSOLE && !FDI_PLANNER
#include "programs/monitor/planner_page.h"
#endif

namespace fdi::monitor {

#if !FDI_PLANNER
void AddGroupsOption(report::Program& program, CLI::App& /*run*/,
                     std::filesystem::path& /*groups*/) {
  program.AddLeftOut("run", "--groups", "FDI_PLANNER");
}

std::shared_ptr<ServicePart> FollowCauses(
    const std::filesystem::path& /*groups*/, const report::Context& context) {
  const std::filesystem::path usual = context.options.data_dir / "groups.toml";
  if (std::filesystem::exists(usual)) {
    context.log(
        LogLevel::kWarning,
        EventLine("groups_ignored",
                  {{"file", usual.string()},
                   {"reason", report::LeftOut("the search for common causes",
                                              "FDI_PLANNER")}}));
  }
  return nullptr;
}
#endif

#if FDI_CONSOLE && !FDI_PLANNER
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

#if !FDI_CONSOLE
void AddPageOptions(report::Program& program, CLI::App& /*run*/,
                    PageOptions& /*options*/) {
  program.AddLeftOut("run", "--console", "FDI_CONSOLE");
}

std::shared_ptr<ServicePart> MakePage(const PageOptions& /*options*/,
                                      const std::filesystem::path& /*groups*/,
                                      const std::string& /*valves*/,
                                      const report::Context& /*context*/) {
  return nullptr;
}
#endif

#if !FDI_CONSOLE || !FDI_PLANT
void AddConsoleVerb(report::Program& program) {
  program.AddLeftOut("", "console", FDI_PLANT ? "FDI_CONSOLE" : "FDI_PLANT");
}
#endif

}  // namespace fdi::monitor
