#include "trainer/scoring/evaluate.h"

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "programs/trainer/verbs.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/scoring/evaluation_report.h"
#include "trainer/scoring/scored_runs.h"

namespace fdi::trainer {
namespace {

struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  RunSelection selection;
  bool assume_normal{false};
};

// The model set asked for, or the one that is assigned to the valve.
ModelSet LoadModels(const EvaluateOptions& options,
                    const report::Context& context) {
  if (options.model_set.empty() == options.valve.empty()) {
    throw ConfigError("either --model-set NAME[@VERSION] or --valve ID");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  if (!options.model_set.empty()) {
    return store.Load(options.model_set);
  }
  if (const auto assigned = store.AssignedModelSet(options.valve)) {
    return store.Load(*assigned);
  }
  throw NotFoundError("no model set is assigned to valve " + options.valve +
                      ": see fdi-store valves assign");
}

report::Report RunEvaluate(const EvaluateOptions& options,
                           const report::Context& context) {
  const auto models =
      std::make_shared<const ModelSet>(LoadModels(options, context));
  const auto runs = LoadSelected(options.selection, *models, context);
  return EvaluationReport(*models,
                          Evaluate(models, runs, options.assume_normal));
}

}  // namespace

void AddEvaluateVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "evaluate",
              "Score runs whose faults are known with the monitor's engine",
              RunEvaluate);
  verb.add_option("--model-set", options.model_set, "NAME (its active version)")
      ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve,
                  "Take the model set assigned to this valve")
      ->type_name("ID");
  options.selection.AddTo(verb);
  verb.add_flag("--assume-normal", options.assume_normal,
                "Samples without truth count as free of faults");
  program.AllowCsv(verb, "One line per run instead of tables");
}

}  // namespace fdi::trainer
