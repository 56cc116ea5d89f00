#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "programs/trainer/verbs.h"
#include "report/fault_texts.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/scoring/evaluation_report.h"
#include "trainer/scoring/report_page.h"

namespace fdi::trainer {
namespace {

struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  RunSelection selection;
  std::filesystem::path vectors;
  std::filesystem::path report;
  bool assume_normal{false};
  bool second_look{true};
};

// The model set asked for, or the one that is assigned to the valve.
std::shared_ptr<const ModelSet> LoadModels(const EvaluateOptions& options,
                                           const report::Context& context) {
  if (options.model_set.empty() == options.valve.empty()) {
    throw ConfigError("either --model-set NAME[@VERSION] or --valve ID");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  ModelSet models;
  if (!options.model_set.empty()) {
    models = store.Load(options.model_set);
  } else if (const auto assigned = store.AssignedModelSet(options.valve)) {
    models = store.Load(*assigned);
  } else {
    throw NotFoundError("no model set is assigned to valve " + options.valve +
                        ": see fdi-store valves assign");
  }
  if (!options.second_look) {
    models.physics.clear();
  }
  return std::make_shared<const ModelSet>(std::move(models));
}

// Writes the vectors and the page, too, if they are asked for.
std::vector<EvaluatedRun> ScoreAndWrite(const EvaluateOptions& options,
                                        const report::Context& context,
                                        const Detector& detector,
                                        const ModelSet& models,
                                        const std::vector<ScoredRun>& runs) {
  EvaluationSettings settings{options.assume_normal};
  std::optional<ReportPage> page;
  if (!options.report.empty()) {
    page.emplace(models, report::LoadFaultTexts(context.options), runs.size());
    settings.watch = [&](const ScoredRun& run) { return page->Watch(run); };
    settings.scored = [&](const ScoredRun& run, const EvaluatedRun& result,
                          const std::vector<Indication>& indications) {
      page->Draw(run, result, indications);
    };
  }
  std::vector<EvaluatedRun> results;
  if (options.vectors.empty()) {
    results = Evaluate(detector, runs, settings);
  } else {
    report::WriteOutput(options.vectors, [&](std::ostream& out) {
      VectorsCsv vectors(out, models);
      settings.threads = 1;  // One file: in the order of the runs.
      settings.watch = [&](const ScoredRun& run) -> VerdictSink {
        return [&, draw = page ? page->Watch(run) : VerdictSink{}](
                   const Sample& sample, const Verdict& verdict) {
          vectors.Add(run.name, verdict);
          if (draw) {
            draw(sample, verdict);
          }
        };
      };
      results = Evaluate(detector, runs, settings);
    });
  }
  if (page) {
    report::WriteOutput(options.report / "index.html", [&](std::ostream& out) {
      page->Print(out, detector, results, context.software,
                  context.command_line);
    });
  }
  return results;
}

report::Report RunEvaluate(const EvaluateOptions& options,
                           const report::Context& context) {
  if (options.selection.table.given() && options.selection.files.empty()) {
    throw ConfigError("--map, --zone and --resample describe a --file");
  }
  if (!options.report.empty()) {
    report::EnsureFolder(options.report);
  }
  const auto models = LoadModels(options, context);
  const Detector detector = EngineDetector(models);
  const auto runs = LoadScoredRuns(options.selection, detector.required,
                                   detector.flow, context);
  return EvaluationReport(
      detector, ScoreAndWrite(options, context, detector, *models, runs));
}

// Our own evidence is measured with a program of the source tree.
void RefuseStudies(report::Program& program) {
  const std::string study =
      "it is in fdi-study, which the source tree builds with -DFDI_BENCH=ON: "
      "fdi-study ";
  program.AddRemoved("evaluate", "--leave-one-out", study + "leave-one-out");
  program.AddRemoved("evaluate", "--seeds", study + "seeds");
  program.AddRemoved("evaluate", "--verdicts", study + "verdicts");
  program.AddRemoved("evaluate", "--baseline", study + "baseline");
  program.AddRemoved("evaluate", "--train-runs", study + "baseline");
  program.AddRemoved("evaluate", "--train-file", study + "baseline");
  program.AddRemoved("evaluate", "--without", study + "reduce");
  program.AddRemoved("evaluate", "--without-channels", study + "reduce");
  for (const char* option : {"--history", "--work-orders", "--horizon"}) {
    program.AddRemoved(
        "evaluate", option,
        "score each file with --file, or replay it into a monitor "
        "(fdi-simulator "
        "replay --csv FILE) and compare fdi-store history list with the work "
        "orders");
  }
}

}  // namespace

void AddEvaluateVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "evaluate",
      "Score runs with the monitor's engine: indices, confusion matrix, report",
      RunEvaluate);
  verb.add_option("--model-set", options.model_set, "NAME (its active version)")
      ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve,
                  "Take the model set assigned to this valve")
      ->type_name("ID");
  options.selection.AddTo(verb);
  verb.add_option("--report", options.report,
                  "Write DIR/index.html: tables and traces of every run")
      ->type_name("DIR");
  verb.add_option("--vectors", options.vectors,
                  "Write every decision vector, numbers as hex floats")
      ->type_name("FILE.csv");
  verb.add_flag("!--no-second-look", options.second_look,
                "Score what the observers say, without the second look by "
                "the physics of an onboarded valve");
  verb.add_flag("--assume-normal", options.assume_normal,
                "Samples without truth count as free of faults");
  program.AllowCsv(verb, "One line per run instead of tables");
  RefuseStudies(program);
}

}  // namespace fdi::trainer
