#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/cli/output_folder.h"
#include "storage/cli/program.h"
#include "storage/cli/progress.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "storage/runs.h"
#include "trainer/app/campaign.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/evaluation_report.h"
#include "trainer/app/file_runs.h"
#include "trainer/app/report_page.h"
#include "trainer/app/report_trace.h"
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
  std::vector<std::string> files;
  std::filesystem::path campaign;
  std::uint64_t seed_offset{0};
  std::filesystem::path map;
  std::filesystem::path vectors;
  std::filesystem::path report;
  bool assume_normal{false};
  bool csv{false};
};

// A run to score, under the name it is listed by.
struct ScoredRun {
  storage::StoredRun run;
  std::string name;
  double horizon_s{0.0};
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

struct Evaluation {
  std::vector<EvaluatedRun> runs;
  std::vector<RunTrace> traces;  // Of every run if there is a report.
};

// Also fills `trace`, and adds to `vectors`, unless there is none.
EvaluatedRun EvaluateRun(const std::shared_ptr<const ModelSet>& models,
                         const ScoredRun& scored, bool assume_normal,
                         VectorsCsv* vectors, RunTrace* trace) {
  const auto& [run, name, horizon_s] = scored;
  const double duration_s = DurationOf(run);
  std::optional<RunTraceRecorder> recorder;
  if (trace != nullptr) {
    recorder.emplace(*models, duration_s);
  }
  const VerdictSink sink = [&](const Sample&, const Verdict& verdict) {
    if (vectors != nullptr) {
      vectors->Add(name, verdict);
    }
    if (recorder) {
      recorder->Add(verdict);
    }
  };
  const std::vector<Indication> indications = Rescore(models, run, sink);
  if (recorder) {
    *trace = recorder->Finish(indications);
  }
  EvaluatedRun result;
  result.indices = ComputeIndices(indications, horizon_s);
  result.indices.run_id = name;
  result.has_truth = assume_normal || HasTruth(run);
  result.duration_s = duration_s;
  for (const Indication& indication : indications) {
    if (!indication.isolated.empty()) {
      result.last_set = indication.isolated;
    }
  }
  return result;
}

// The validation runs of a campaign, simulated or imported where missing.
void AddValidation(const EvaluateOptions& options, const cli::Context& context,
                   const storage::DataDirectory& directory,
                   std::vector<ScoredRun>& runs) {
  std::vector<CampaignRun> validation =
      LoadCampaign(options.campaign).validation;
  if (validation.empty()) {
    throw ConfigError(options.campaign.string() +
                      ": there is no [[validation]]");
  }
  for (CampaignRun& run : validation) {
    if (auto* simulated = std::get_if<SimulatedRun>(&run.source)) {
      simulated->scenario.config.seed += options.seed_offset;
    }
  }
  const cli::StopSignals signals;
  std::optional<cli::Progress> progress;
  const CollectedRuns collected =
      CollectRuns(validation, directory, {context.software, cli::NowNs(), 0},
                  [&](double share, const std::string& what) {
                    if (signals.stop_requested()) {
                      throw Interrupted("interrupted");
                    }
                    if (!progress) {
                      progress.emplace("simulate");
                    }
                    progress->Update(share, what);
                  });
  if (progress) {
    progress->Finish();
  }
  storage::RunStore store(directory.runs());
  for (std::size_t i = 0; i < validation.size(); ++i) {
    runs.push_back({store.Load(collected.selectors[i]), RunLabel(validation[i]),
                    validation[i].horizon_s});
  }
}

std::vector<ScoredRun> LoadRuns(const EvaluateOptions& options,
                                const ModelSet& models,
                                const cli::Context& context,
                                const storage::DataDirectory& directory) {
  std::vector<ScoredRun> runs;
  const auto add = [&](storage::StoredRun run) {
    std::string name = RunName(run);
    runs.push_back({std::move(run), std::move(name), 0.0});
  };
  if (!options.campaign.empty()) {
    AddValidation(options, context, directory, runs);
  }
  if (!options.runs.empty()) {
    storage::RunStore store(directory.runs());
    for (const std::string& selector : options.runs) {
      add(store.Load(selector));
    }
  }
  std::optional<storage::ColumnMap> map;
  if (!options.map.empty()) {
    map = cli::ReadTagMap(options.map);
  }
  for (const std::string& file : options.files) {
    add(ReadRunFile(file, map, RequiredSignals(models)));
  }
  return runs;
}

Evaluation EvaluateRuns(const EvaluateOptions& options,
                        const std::shared_ptr<const ModelSet>& models,
                        const std::vector<ScoredRun>& runs) {
  std::optional<VectorsCsv> vectors;
  if (!options.vectors.empty()) {
    vectors.emplace(options.vectors, *models);
  }
  Evaluation result;
  result.runs.resize(runs.size());
  result.traces.resize(options.report.empty() ? 0 : runs.size());
  const int threads = vectors ? 1 : 0;  // One file: in the order of the runs.
  ParallelFor(static_cast<int>(runs.size()), threads, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    result.runs[r] = EvaluateRun(
        models, runs[r], options.assume_normal, vectors ? &*vectors : nullptr,
        result.traces.empty() ? nullptr : &result.traces[r]);
  });
  if (vectors) {
    vectors->Commit();
  }
  return result;
}

int Evaluate(const EvaluateOptions& options, const cli::Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("either --json or --csv");
  }
  if (options.runs.empty() && options.files.empty() &&
      options.campaign.empty()) {
    throw ConfigError(
        "what to score: --runs ID,..., --file FILE.csv or "
        "--campaign FILE.toml");
  }
  if (!options.report.empty()) {
    cli::EnsureFolder(options.report);
  }
  const storage::DataDirectory directory{context.options.data_dir};
  const auto models =
      std::make_shared<const ModelSet>(LoadModels(options, directory));
  const auto [runs, traces] = EvaluateRuns(
      options, models, LoadRuns(options, *models, context, directory));
  if (!options.report.empty()) {
    cli::WriteFile(options.report / "index.html",
                   ReportPage({*models, runs, traces, context.software,
                               context.command_line}));
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, EvaluationJson(*models, runs));
  } else if (options.csv) {
    WriteEvaluationCsv(std::cout, runs);
  } else {
    PrintEvaluation(std::cout, *models, runs);
  }
  return cli::kExitOk;
}

void AddOptions(CLI::App& verb, EvaluateOptions& options) {
  CLI::Option* set = verb.add_option("--model-set", options.model_set,
                                     "NAME (its active version)")
                         ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve,
                  "Take the model set assigned to this valve")
      ->type_name("ID")
      ->excludes(set);
  verb.add_option("--runs", options.runs, "Runs, or stretches of them [s]")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  CLI::Option* files =
      verb.add_option("--file", options.files,
                      "CSV file scored without storing it; repeatable")
          ->expected(1)
          ->take_all()
          ->type_name("FILE.csv[@from:to]");
  verb.add_option("--campaign", options.campaign,
                  "Its validation runs; simulates or imports what is missing")
      ->type_name("FILE.toml");
  verb.add_option("--seed-offset", options.seed_offset,
                  "Added to the seeds of simulated validation runs")
      ->check(CLI::Range(0, 1000000000))
      ->type_name("N");
  verb.add_option("--map", options.map,
                  "TOML file: names, units, scale, offset, sense of columns")
      ->type_name("FILE.toml")
      ->needs(files);
  verb.add_option("--report", options.report,
                  "Write DIR/index.html: tables and traces of every run")
      ->type_name("DIR");
  verb.add_option("--vectors", options.vectors,
                  "Write every decision vector, numbers as hex floats")
      ->type_name("FILE.csv");
  verb.add_flag("--assume-normal", options.assume_normal,
                "What has no truth counts as free of faults");
  verb.add_flag("--csv", options.csv, "One line per run instead of tables");
}

}  // namespace

void AddEvaluateVerb(cli::Program& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App& verb = program.AddVerb(
      "evaluate",
      "Score runs with the monitor's engine: indices, confusion matrix, report",
      [options](const cli::Context& context) {
        return Evaluate(*options, context);
      });
  AddOptions(verb, *options);
}

}  // namespace fdi::trainer
