#include "bench/study/verbs.h"
#include "report/program.h"
#include "storage/database/database.h"

// NOLINTNEXTLINE(bugprone-exception-escape): of no memory it may end.
int main(int argc, char** argv) {
  fdi::report::Program program(
      "fdi-study", "Measures what docs/results.md says about the diagnosis");
  program.MapError<fdi::storage::SqliteError>(fdi::report::kExitData);
  fdi::trainer::study::AddEvaluateVerb(program);
  fdi::trainer::study::AddAblateVerb(program);
  fdi::trainer::study::AddScoringVerbs(program);
  fdi::trainer::study::AddReduceVerb(program);
  fdi::trainer::study::AddInjectVerb(program);
  fdi::trainer::study::AddPicturesVerb(program);
  fdi::trainer::study::AddBudgetVerbs(program);
  return program.Run(argc, argv);
}
