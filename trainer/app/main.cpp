#include "storage/cli/program.h"
#include "trainer/app/examples.h"
#include "trainer/app/verbs.h"

int main(int argc, char** argv) {
  fdi::cli::Program program(
      "fdi-trainer",
      "Builds model sets from stored or simulated runs and scores them");
  fdi::trainer::AddTrainVerb(program);
  fdi::trainer::AddEvaluateVerb(program);
  fdi::trainer::AddCompareVerb(program);
  fdi::trainer::AddShowVerb(program);
  fdi::trainer::AddInjectVerb(program);
  fdi::trainer::AddOnboardVerb(program);
  fdi::trainer::AddCoverageVerb(program);
  program.AddExamples(fdi::trainer::Examples());
  return program.Run(argc, argv);
}
