#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/cli/program.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "storage/runs.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/rescore.h"
#include "trainer/app/run_input.h"
#include "trainer/app/vectors_csv.h"
#include "trainer/app/verbs.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  std::vector<std::string> runs;
  std::filesystem::path vectors;
  bool assume_normal{false};
  bool csv{false};
};

ModelSet LoadModels(const EvaluateOptions& options,
                    const storage::DataDirectory& directory) {
  if (options.model_set.empty() == options.valve.empty()) {
    throw ConfigError("either --model-set NAME[@VERSION] or --valve ID");
  }
  storage::ModelStore store(directory.models());
  if (!options.model_set.empty()) {
    return store.Load(options.model_set);
  }
  const auto assigned = store.AssignedModelSet(options.valve);
  if (!assigned) {
    throw NotFoundError("no model set is assigned to valve " + options.valve +
                        ": see fdi-store valves assign");
  }
  return store.Load(*assigned);
}

double DurationOf(const storage::StoredRun& run) {
  std::int64_t first = run.samples.front().sample.stamp_ns;
  std::int64_t last = first;
  for (const storage::StoredSample& stored : run.samples) {
    first = std::min(first, stored.sample.stamp_ns);
    last = std::max(last, stored.sample.stamp_ns);
  }
  return static_cast<double>(last - first) * 1e-9 + run.info.run.period_s;
}

EvaluatedRun EvaluateRun(const std::shared_ptr<const ModelSet>& models,
                         const storage::StoredRun& run, bool assume_normal,
                         VectorsCsv* vectors) {
  const std::string name = RunName(run);
  VerdictSink sink;
  if (vectors != nullptr) {
    sink = [&](const Sample&, const Verdict& verdict) {
      vectors->Add(name, verdict);
    };
  }
  const std::vector<Indication> indications = Rescore(models, run, sink);
  EvaluatedRun result;
  result.indices = ComputeIndices(indications);
  result.indices.run_id = name;
  result.has_truth = assume_normal || HasTruth(run);
  result.duration_s = DurationOf(run);
  for (const Indication& indication : indications) {
    if (!indication.isolated.empty()) {
      result.last_set = indication.isolated;
    }
  }
  return result;
}

std::vector<EvaluatedRun> EvaluateRuns(
    const EvaluateOptions& options,
    const std::shared_ptr<const ModelSet>& models,
    const storage::DataDirectory& directory) {
  storage::RunStore store(directory.runs());
  std::vector<storage::StoredRun> runs;
  for (const std::string& selector : options.runs) {
    runs.push_back(store.Load(selector));
  }
  std::optional<VectorsCsv> vectors;
  if (!options.vectors.empty()) {
    vectors.emplace(options.vectors, *models);
  }
  std::vector<EvaluatedRun> results(runs.size());
  const int threads = vectors ? 1 : 0;  // One file: in the order of the runs.
  ParallelFor(static_cast<int>(runs.size()), threads, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    results[r] = EvaluateRun(models, runs[r], options.assume_normal,
                             vectors ? &*vectors : nullptr);
  });
  if (vectors) {
    vectors->Commit();
  }
  return results;
}

int Evaluate(const EvaluateOptions& options, const cli::Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("either --json or --csv");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  const auto models =
      std::make_shared<const ModelSet>(LoadModels(options, directory));
  const auto runs = EvaluateRuns(options, models, directory);
  if (context.options.json) {
    cli::PrintJson(std::cout, EvaluationJson(*models, runs));
  } else if (options.csv) {
    WriteEvaluationCsv(std::cout, runs);
  } else {
    PrintEvaluation(std::cout, runs);
  }
  return cli::kExitOk;
}

}  // namespace

void AddEvaluateVerb(cli::Program& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App& verb = program.AddVerb(
      "evaluate",
      "Score stored runs with the monitor's engine: indices, confusion matrix",
      [options](const cli::Context& context) {
        return Evaluate(*options, context);
      });
  CLI::Option* set = verb.add_option("--model-set", options->model_set,
                                     "NAME (its active version)")
                         ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options->valve,
                  "Take the model set assigned to this valve")
      ->type_name("ID")
      ->excludes(set);
  verb.add_option("--runs", options->runs, "Runs, or stretches of them [s]")
      ->required()
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--vectors", options->vectors,
                  "Write every decision vector, numbers as hex floats")
      ->type_name("FILE.csv");
  verb.add_flag("--assume-normal", options->assume_normal,
                "What has no truth counts as free of faults");
  verb.add_flag("--csv", options->csv, "One line per run instead of tables");
}

}  // namespace fdi::trainer
