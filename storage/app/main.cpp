#include "storage/app/examples.h"
#include "storage/app/verbs.h"
#include "storage/cli/program.h"

int main(int argc, char** argv) {
  fdi::cli::Program program(
      "fdi-store",
      "Runs, model sets, valves and the fault history of the data directory");
  fdi::storage::AddRunsVerbs(program);
  fdi::storage::AddModelsVerbs(program);
  fdi::storage::AddValvesVerbs(program);
  fdi::storage::AddTypesVerbs(program);
  fdi::storage::AddHistoryVerbs(program);
  fdi::storage::AddEvidenceVerbs(program);
  fdi::storage::AddPlotVerbs(program);
  fdi::storage::AddCausesVerb(program);
  fdi::storage::AddFaultsVerb(program);
  fdi::storage::AddHealthVerbs(program);
  fdi::storage::AddWorkListVerb(program);
  fdi::storage::AddShadowVerb(program);
  fdi::storage::AddMaintenanceVerbs(program);
  fdi::storage::AddPruneVerb(program);
  program.AddExamples(fdi::storage::Examples());
  return program.Run(argc, argv);
}
