#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/csv_cells.h"
#include "base/error.h"
#include "bench/study/evaluation_report.h"
#include "bench/study/report_page.h"
#include "bench/study/verbs.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/fault_texts.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"

namespace fdi::trainer::study {
namespace {

struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  StudySelection selection;
  std::filesystem::path vectors;
  std::filesystem::path report;
  bool assume_normal{false};
  bool second_look{true};
};

// The file of `evaluate --vectors`: one line per sample with what the engine
// said. Numbers are hex floats (%a), so that lines of equal bits are equal.
// Columns: run, stamp_ns, source_id, seq, intake, initialised, quality, state,
// r_CHANNEL, d_0, d_FAULT, isolated (f3|f6), o_OBSERVER.
class VectorsCsv {
 public:
  // `out` and `models` must outlive it.
  VectorsCsv(std::ostream& out, const ModelSet& models);
  void Add(const std::string& run, const Verdict& verdict);

 private:
  std::ostream& out_;
  const ModelSet& models_;
};

VectorsCsv::VectorsCsv(std::ostream& out, const ModelSet& models)
    : out_(out), models_(models) {
  std::vector<std::string> header{"run",     "stamp_ns", "source_id",
                                  "seq",     "intake",   "initialised",
                                  "quality", "state"};
  for (const ChannelSpec& channel : models_.channels) {
    header.push_back("r_" + channel.name);
  }
  header.emplace_back("d_0");
  for (const int fault : models_.faults) {
    header.push_back("d_" + FaultName(fault));
  }
  header.emplace_back("isolated");
  for (const Observer& observer : models_.observers) {
    header.push_back("o_" + observer.name);
  }
  WriteCsvLine(out_, header);
}

void VectorsCsv::Add(const std::string& run, const Verdict& verdict) {
  std::vector<std::string> cells{run,
                                 std::to_string(verdict.stamp_ns),
                                 std::to_string(verdict.source_id),
                                 std::to_string(verdict.seq),
                                 std::string(IntakeName(verdict.intake)),
                                 verdict.initialised ? "1" : "0",
                                 std::string(QualityName(verdict.quality)),
                                 std::string(StateName(verdict.state))};
  const auto add = [&cells](double value) {
    std::array<char, 40> text{};
    // Hexadecimal keeps every bit: two engines that ought to agree can be
    // compared by the text of their files.
    std::snprintf(text.data(), text.size(), "%a", value);
    cells.emplace_back(text.data());
  };
  for (std::size_t c = 0; c < models_.channels.size(); ++c) {
    add(verdict.residuals[c]);
  }
  add(verdict.normal_factor);
  for (std::size_t f = 0; f < models_.faults.size(); ++f) {
    add(verdict.fault_factors[f]);
  }
  cells.push_back(verdict.isolated == 0
                      ? std::string()
                      : FaultSetName(models_, verdict.isolated));
  for (std::size_t o = 0; o < models_.observers.size(); ++o) {
    add(verdict.observer_factors[o]);
  }
  WriteCsvLine(out_, cells);
}

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
Scores ScoreAndWrite(const EvaluateOptions& options,
                     const report::Context& context, const Detector& detector,
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
  Scores results;
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
  if (!options.report.empty()) {
    std::filesystem::create_directory(options.report);
  }
  const auto models = LoadModels(options, context);
  const Detector detector = EngineDetector(models);
  const auto runs = LoadScoredRuns(options.selection, detector.required,
                                   detector.flow, context);
  return EvaluationReport(
      detector, ScoreAndWrite(options, context, detector, *models, runs));
}

}  // namespace

void AddEvaluateVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "evaluate",
              "Score runs with the monitor's engine by all indices: confusion "
              "matrices, report, decision vectors",
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
  program.AddExamples({{"evaluate",
                        {{"The benchmark",
                          "fdi-study evaluate --model-set benchmark --campaign "
                          "campaigns/benchmark.toml"},
                         {"With a report to look at",
                          "fdi-study evaluate --model-set benchmark --campaign "
                          "campaigns/benchmark.toml --report report"}}}});
}

}  // namespace fdi::trainer::study
