// The replies of this program in a build without an optional component.
#include "base/error.h"
#include "programs/store/verbs.h"

namespace fdi::storage {

#if !FDI_PLANNER
void AddPlannerVerbs(report::Program& program) {
  for (const char* verb : {"health", "worklist"}) {
    program.AddLeftOut("", verb, "FDI_PLANNER");
  }
}
#endif

#if !FDI_PLANT
void AddShipVerb(report::Program& program) {
  program.AddLeftOut("", "ship", "FDI_PLANT");
}

bool ReadsPlants() {
  return false;
}

std::unique_ptr<History> OpenPlant(const PlantOptions& /*plant*/) {
  throw ConfigError(report::LeftOut("--db", "FDI_PLANT"));
}

Report PrunePlant(const PlantPrune& /*options*/, const Context& /*context*/) {
  throw ConfigError(report::LeftOut("--db", "FDI_PLANT"));
}
#endif

}  // namespace fdi::storage
