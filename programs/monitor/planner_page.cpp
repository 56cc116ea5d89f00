#include "programs/monitor/planner_page.h"

#include "planner/page/console_routes.h"
#include "programs/monitor/planner.h"

namespace fdi::monitor {

std::vector<console::Route> PlannerRoutes(const std::filesystem::path& groups,
                                          const report::Context& context) {
  return planner::ConsoleRoutes(ReadGroups(groups, context));
}

}  // namespace fdi::monitor
