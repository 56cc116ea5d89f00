#include "diagnosis/error.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

TrainingOptions Paper() {
  using enum Signal;
  TrainingOptions options;
  options.preset = "paper";
  options.channels = {
      {"X",
       kX,
       true,
       {{{kCv, 0},
         {kCv, 1},
         {kCv, 2},
         {kCv, 3},
         {kP1, 0},
         {kP1, 1},
         {kP2, 0},
         {kP2, 1},
         {kT1, 0},
         {kX, 1},
         {kX, 2}}}},
      {"F",
       kF,
       true,
       {{{kCv, 0},
         {kCv, 1},
         {kCv, 2},
         {kP1, 0},
         {kP1, 1},
         {kP2, 0},
         {kP2, 1},
         {kT1, 0},
         {kF, 1}},
        {{kX, 0}, {kX, 1}, {kP1, 0}, {kP2, 0}, {kT1, 0}, {kF, 1}}}}};
  options.fit.rules.min_rules = 1;
  options.fit.rules.max_rules = 5;
  options.fit.rules.fit.clustering.num_starts = 2;
  options.fit.rules.fit.clustering.max_iterations = 60;
  options.fit.structure.relative_improvement = 0.02;
  options.fit.max_rows = 3000;
  // With four or five regressors and m = 2 the partition tends to the trivial
  // one, and with it the model to a linear one.
  options.fit.rules.fit.clustering.fuzziness = 1.5;
  return options;
}

}  // namespace

TrainingOptions PresetOptions(std::string_view preset) {
  if (preset == "paper") {
    return Paper();
  }
  throw ConfigError("unknown preset '" + std::string(preset) +
                    "': expected paper");
}

}  // namespace fdi::trainer
