#include "import/tag_map.h"
#include "programs/trainer/verbs.h"
#include "report/program.h"
#include "storage/database/database.h"

// NOLINTNEXTLINE(bugprone-exception-escape): of no memory it may end.
int main(int argc, char** argv) {
  fdi::report::Program program(
      "fdi-trainer",
      "Builds model sets from stored or simulated runs and scores them");
  program.MapError<fdi::storage::SqliteError>(fdi::report::kExitData);
  fdi::trainer::AddTrainVerb(program);
  fdi::trainer::AddEvaluateVerb(program);
  fdi::trainer::AddCompareVerb(program);
  fdi::trainer::AddShowVerb(program);
  fdi::trainer::AddOnboardVerb(program);
  fdi::trainer::AddRelearnVerb(program);
  program.AddExamples(
      {{"",
        {{"Train the paper's observers",
          "fdi-trainer train --campaign campaigns/paper.toml"},
         {"Models for a healthy valve of the plant",
          "fdi-trainer onboard --valve FV-101 --runs 1a2b,3c4d"},
         {"Score them on runs with known faults",
          "fdi-trainer evaluate --model-set paper --runs 5e6f"}}},
       {"evaluate",
        {{"How fast and how right, on stored runs with known faults",
          "fdi-trainer evaluate --model-set paper --runs 1a2b,3c4d"},
         {"Hours of a file in which the valve was healthy",
          "fdi-trainer evaluate --valve FV-101 --file day.csv "
          "--assume-normal"}}},
       {"compare",
        {{"Is version 2 better?",
          "fdi-trainer compare paper@1 paper@2 --runs 1a2b,3c4d"},
         {"On a file",
          "fdi-trainer compare paper@1 paper@2 --file day.csv"}}}});
  return program.Run(argc, argv);
}
