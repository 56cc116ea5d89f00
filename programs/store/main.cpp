#include "import/tag_map.h"
#include "programs/store/verbs.h"
#include "storage/database/database.h"

// NOLINTNEXTLINE(bugprone-exception-escape): only std::bad_alloc.
int main(int argc, char** argv) {
  fdi::report::Program program(
      "fdi-store",
      "Runs, model sets, valves and the fault history of the data directory");
  program.MapError<fdi::storage::SqliteError>(fdi::report::kExitData);
  fdi::storage::AddRunsVerbs(program);
  fdi::storage::AddModelsVerbs(program);
  fdi::storage::AddValvesVerbs(program);
  fdi::storage::AddTypesVerbs(program);
  fdi::storage::AddHistoryVerbs(program);
  fdi::storage::AddFaultsVerb(program);
  fdi::storage::AddPlannerVerbs(program);
  fdi::storage::AddMaintenanceVerbs(program);
  fdi::storage::AddShipVerb(program);
  fdi::storage::AddAuditVerb(program);
  program.AddExamples(fdi::storage::Examples());
  return program.Run(argc, argv);
}
