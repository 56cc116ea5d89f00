#include "trainer/app/examples.h"

namespace fdi::trainer {
namespace {

std::vector<cli::VerbExamples> TrainingExamples() {
  return {
      {"train",
       {{"The paper's observers, simulating what they are trained on",
         "fdi-trainer train --campaign campaigns/paper.toml"},
        {"From stored runs",
         "fdi-trainer train --name unit1 --preset extended --runs "
         "1a2b,3c4d@0:3600"},
        {"The next version, from what episodes were labelled",
         "fdi-trainer train --from-labels --since 30d"}}},
      {"onboard",
       {{"A valve of the plant that has only ever been healthy",
         "fdi-trainer onboard --valve FV-101 --runs 1a2b,3c4d"},
        {"From a CSV file, with what it would gain by more transmitters",
         "fdi-trainer onboard --valve FV-101 --file fv101.csv --gains"}}},
  };
}

std::vector<cli::VerbExamples> ScoringExamples() {
  return {
      {"evaluate",
       {{"How fast and how right, on stored runs with known faults",
         "fdi-trainer evaluate --model-set paper --runs 1a2b,3c4d"},
        {"With a report to look at",
         "fdi-trainer evaluate --model-set paper@2 --campaign "
         "campaigns/paper.toml --report report"}}},
      {"compare",
       {{"Is version 2 better?",
         "fdi-trainer compare paper@1 paper@2 --runs 1a2b,3c4d"},
        {"On a file", "fdi-trainer compare paper@1 paper@2 --file day.csv"}}},
      {"show",
       {{"Fit of every observer", "fdi-trainer show paper"},
        {"Its rules in words", "fdi-trainer show paper@2 --rules"}}},
      {"inject",
       {{"What a worn seat would have looked like in this record",
         "fdi-trainer inject --run 1a2b --fault f6:abrupt@600:strength=0.5 -o "
         "f6.csv"},
        {"On a file of the plant",
         "fdi-trainer inject --file day.csv --fault "
         "f19:incipient@300+600:strength=0.4 -o f19.csv"}}},
      {"coverage",
       {{"What a valve with three transmitters can tell",
         "fdi-trainer coverage --signals CV,X,F"},
        {"Without what one more would buy",
         "fdi-trainer coverage --signals CV,X --no-gains"}}},
  };
}

}  // namespace

std::vector<cli::VerbExamples> Examples() {
  std::vector<cli::VerbExamples> all = {
      {"",
       {{"Train the paper's observers",
         "fdi-trainer train --campaign campaigns/paper.toml"},
        {"Models for a healthy valve of the plant",
         "fdi-trainer onboard --valve FV-101 --runs 1a2b,3c4d"},
        {"Score them on runs with known faults",
         "fdi-trainer evaluate --model-set paper --runs 5e6f"}}}};
  for (const auto& part : {TrainingExamples(), ScoringExamples()}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

}  // namespace fdi::trainer
