#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "diagnosis/fault_catalogue.h"
#include "programs/trainer/verbs.h"
#include "report/output_folder.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/evaluation/back_test.h"
#include "trainer/evaluation/evaluation_report.h"
#include "trainer/evaluation/report_page.h"
#include "trainer/evaluation/studies.h"
#include "trainer/model_reduction.h"

namespace fdi::trainer {
namespace {

constexpr double kDayS = 86400.0;

struct EvaluateOptions {
  std::string model_set;
  std::string valve;
  RunSelection selection;
  std::vector<std::string> without;           // Faults.
  std::vector<std::string> without_channels;  // Names.
  bool leave_one_out{false};
  int seeds{0};                          // 0: those of the campaign alone.
  std::vector<std::string> verdicts;     // Files, one per run.
  std::string baseline;                  // Of BaselineNames(); empty: none.
  std::vector<std::string> train_runs;   // Of the baseline.
  std::vector<std::string> train_files;  // Of the baseline.
  std::string history;                   // Folder or pattern of CSV files.
  std::filesystem::path work_orders;
  double horizon_days{30.0};  // Between an episode and its work order.
  std::filesystem::path vectors;
  std::filesystem::path report;
  bool assume_normal{false};
  bool second_look{true};
  bool csv{false};
};

// The model set asked for, or the one that is assigned to `valve`, without the
// faults and channels that it is to do without.
std::shared_ptr<const ModelSet> LoadModels(const EvaluateOptions& options,
                                           const std::string& valve,
                                           const report::Context& context) {
  if (options.model_set.empty() == valve.empty()) {
    throw ConfigError("either --model-set NAME[@VERSION] or --valve ID");
  }
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  ModelSet models;
  if (!options.model_set.empty()) {
    models = store.Load(options.model_set);
  } else if (const auto assigned = store.AssignedModelSet(valve)) {
    models = store.Load(*assigned);
  } else {
    throw NotFoundError("no model set is assigned to valve " + valve +
                        ": see fdi-store valves assign");
  }
  std::vector<int> faults;
  for (const std::string& name : options.without) {
    faults.push_back(RequireFault(name));
  }
  if (!options.second_look) {
    models.physics.clear();
  }
  return std::make_shared<const ModelSet>(WithoutChannels(
      WithoutFaults(std::move(models), faults), options.without_channels));
}

// The runs named for the baseline, else those that the campaign trains on.
std::vector<TrainingRun> TrainingRuns(const EvaluateOptions& options,
                                      const report::Context& context) {
  std::vector<storage::StoredRun> stored;
  if (options.train_runs.empty() && options.train_files.empty()) {
    if (options.selection.campaign.empty()) {
      throw ConfigError(
          "what to fit the baseline to: --train-runs ID,..., --train-file "
          "FILE.csv or a --campaign with [[run]]");
    }
    const Campaign campaign = LoadCampaign(options.selection.campaign);
    if (campaign.runs.empty()) {
      throw ConfigError(options.selection.campaign.string() +
                        ": there is no [[run]] to fit the baseline to");
    }
    stored = LoadCampaignRuns(campaign.runs, context);
  } else {
    stored = LoadRunsAndFiles(
        options.train_runs, options.train_files, {context.options.data_dir},
        options.selection.ForFiles(kBasicSignals, context));
  }
  std::vector<TrainingRun> runs;
  for (const storage::StoredRun& run : stored) {
    runs.push_back(ToTrainingRun(run, options.assume_normal));
  }
  return runs;
}

// Scores with the monitor's engine, and writes the vectors and the page.
std::vector<EvaluatedRun> EvaluateAndWrite(const EvaluateOptions& options,
                                           const report::Context& context,
                                           const Detector& detector,
                                           const ModelSet& models,
                                           const std::vector<ScoredRun>& runs) {
  EvaluationSettings settings{options.assume_normal};
  std::optional<ReportPage> page;
  if (!options.report.empty()) {
    page.emplace(models, runs.size());
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
    report::WriteFile(
        options.report / "index.html",
        page->Html(results, context.software, context.command_line));
  }
  return results;
}

// Scores the selected runs with any detector. @param models those of an engine.
report::Report EvaluateRuns(const EvaluateOptions& options,
                            const report::Context& context,
                            const Detector& detector,
                            const ModelSet* models = nullptr) {
  const auto runs = LoadScoredRuns(options.selection, detector.required,
                                   detector.flow_unit, context);
  if (!options.verdicts.empty() && runs.size() != options.verdicts.size()) {
    throw ConfigError(std::to_string(options.verdicts.size()) +
                      " files of verdicts for " + std::to_string(runs.size()) +
                      " runs: one for each is needed, in the same order");
  }
  std::vector<EvaluatedRun> results;
  if (options.report.empty() && options.vectors.empty()) {
    results = Evaluate(detector, runs, {options.assume_normal});
  } else {
    results = EvaluateAndWrite(options, context, detector, *models, runs);
  }
  if (options.csv) {
    WriteEvaluationCsv(std::cout, results);
    return {};
  }
  return EvaluationReport(detector, results);
}

report::Report EvaluateBaseline(const EvaluateOptions& options,
                                const report::Context& context) {
  const std::vector<TrainingRun> training = TrainingRuns(options, context);
  DatasetOptions dataset;
  dataset.assume_normal = options.assume_normal;
  Detector detector = FittedBaseline(
      FitBaseline(options.baseline, BuildConditions(training, dataset),
                  training.front().period_s, {}));
  detector.flow_unit = training.front().flow_unit;
  return EvaluateRuns(options, context, detector);
}

report::Report EvaluateHistory(const EvaluateOptions& options,
                               const report::Context& context) {
  const std::vector<WorkOrder> orders = ReadWorkOrders(options.work_orders);
  const importer::CsvOptions csv = options.selection.ForFiles(0, context);
  std::vector<PastRecord> records;
  for (const ValveFiles& files : FindHistory(options.history, options.valve)) {
    const auto models = LoadModels(
        options, options.model_set.empty() ? files.valve : "", context);
    records.push_back(FollowHistory(
        files, models, csv, [&](const std::filesystem::path& file) {
          context.log(LogLevel::kInfo,
                      EventLine("history_file", {{"valve", files.valve},
                                                 {"file", file.string()}}));
        }));
  }
  return BackTestReport(
      JudgeHistory(records, orders, options.horizon_days * kDayS), records,
      context.options.utc);
}

// " without f6, channel T1", or empty.
std::string ReductionText(const EvaluateOptions& options) {
  std::string text;
  for (const std::string& fault : options.without) {
    text += (text.empty() ? " without " : ", ") + fault;
  }
  for (const std::string& channel : options.without_channels) {
    text += (text.empty() ? " without channel " : ", channel ") + channel;
  }
  return text;
}

report::Report EvaluateModels(const EvaluateOptions& options,
                              const report::Context& context) {
  if (!options.report.empty()) {
    report::EnsureFolder(options.report);
  }
  const auto models = LoadModels(options, options.valve, context);
  Detector detector = EngineDetector(models);
  if (options.leave_one_out) {
    return LeaveOneOut(*models,
                       LoadScoredRuns(options.selection, detector.required,
                                      detector.flow_unit, context),
                       {options.assume_normal});
  }
  if (options.seeds > 0) {
    return SeedReport(
        detector, RepeatWithSeeds(detector, options.selection, options.seeds));
  }
  const std::string reduction = ReductionText(options);
  if (!reduction.empty()) {
    detector.preface = detector.name + "@" + std::to_string(detector.version) +
                       reduction + '\n';
  }
  report::Report report =
      EvaluateRuns(options, context, detector, models.get());
  if (report.document.contains("summary")) {
    report::Json& summary = report.document["summary"];
    if (!options.without.empty()) {
      summary["without"] = options.without;
    }
    if (!options.without_channels.empty()) {
      summary["without_channels"] = options.without_channels;
    }
  }
  return report;
}

report::Report RunEvaluate(const EvaluateOptions& options,
                           const report::Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("either --json or --csv");
  }
  if (options.selection.table.given() && options.selection.files.empty() &&
      options.train_files.empty() && options.history.empty()) {
    throw ConfigError(
        "--map, --zone and --resample are of --file, --train-file or "
        "--history");
  }
  if (!options.verdicts.empty()) {
    return EvaluateRuns(options, context, VerdictFiles(options.verdicts));
  }
  if (!options.baseline.empty()) {
    return EvaluateBaseline(options, context);
  }
  if (!options.history.empty()) {
    return EvaluateHistory(options, context);
  }
  return EvaluateModels(options, context);
}

void AddModels(CLI::App& verb, EvaluateOptions& options) {
  verb.add_option("--model-set", options.model_set, "NAME (its active version)")
      ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve,
                  "Take the model set assigned to this valve; of a history, "
                  "the valve of all files")
      ->type_name("ID");
  verb.add_option("--without", options.without,
                  "As if the set had never been told of these faults")
      ->delimiter(',')
      ->type_name("FAULT,...");
  verb.add_option("--without-channels", options.without_channels,
                  "As if the set did not have these residual channels")
      ->delimiter(',')
      ->type_name("CHANNEL,...");
}

void AddOutputs(CLI::App& verb, EvaluateOptions& options) {
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
  verb.add_flag("--csv", options.csv, "One line per run instead of tables");
}

CLI::Option* AddHistory(CLI::App& verb, EvaluateOptions& options) {
  CLI::Option* history =
      verb.add_option("--history", options.history,
                      "Back-test: CSV files of months, in folders named after "
                      "their valves (or all of --valve)")
          ->type_name("DIR|GLOB");
  CLI::Option* orders =
      verb.add_option("--work-orders", options.work_orders,
                      "What was found when: valve,time,found (a fault or "
                      "nothing)")
          ->needs(history)
          ->type_name("FILE.csv");
  history->needs(orders);
  verb.add_option("--horizon", options.horizon_days,
                  "Days by which an episode may come before its work order")
      ->needs(history)
      ->check(CLI::Range(0.001, 3650.0))
      ->type_name("DAYS");
  for (const char* other : {"--runs", "--file", "--campaign", "--csv"}) {
    history->excludes(other);
  }
  return history;
}

// Ways of scoring other than by the model set; each excludes the others and the
// outputs it lacks.
void AddScoringOptions(CLI::App& verb, EvaluateOptions& options) {
  CLI::Option* leave =
      verb.add_flag("--leave-one-out", options.leave_one_out,
                    "Score each fault by a set that does not know it");
  CLI::Option* seeds =
      verb.add_option("--seeds", options.seeds,
                      "Repeat the simulated validation runs with so many "
                      "seeds; shares with 95 % intervals")
          ->check(CLI::Range(1, 10000))
          ->type_name("N");
  CLI::Option* verdicts =
      verb.add_option("--verdicts", options.verdicts,
                      "Score another detector: t_s,detected[,faults] of each "
                      "run, in the order of the runs")
          ->delimiter(',')
          ->type_name("FILE.csv,...");
  CLI::Option* baseline =
      verb.add_option("--baseline", options.baseline,
                      "Score a well-known detector, fitted to the "
                      "training runs of the campaign, or those given")
          ->check(CLI::IsMember(BaselineNames()))
          ->type_name("NAME");
  CLI::Option* history = AddHistory(verb, options);
  const std::vector<CLI::Option*> ways{leave, seeds, verdicts, baseline,
                                       history};
  for (CLI::Option* way : ways) {
    for (CLI::Option* other : ways) {
      if (way != other) {
        way->excludes(other);
      }
    }
    way->excludes("--report")->excludes("--vectors");
  }
  leave->excludes("--csv")->excludes("--without");
  seeds->excludes("--csv")->excludes("--runs")->excludes("--file");
  seeds->needs("--campaign");
  for (CLI::Option* way : {verdicts, baseline}) {
    way->excludes("--model-set")->excludes("--valve");
    way->excludes("--without")->excludes("--without-channels");
  }
  verb.add_option("--train-runs", options.train_runs,
                  "Runs that the baseline is fitted to")
      ->delimiter(',')
      ->needs(baseline)
      ->type_name("ID[@from:to],...");
  verb.add_option("--train-file", options.train_files,
                  "CSV file that the baseline is fitted to; repeatable")
      ->expected(1)
      ->take_all()
      ->needs(baseline)
      ->type_name("FILE.csv[@from:to]");
}

}  // namespace

void AddEvaluateVerb(report::Program& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App& verb = program.AddVerb(
      "evaluate",
      "Score runs with the monitor's engine: indices, confusion matrix, report",
      [options](const report::Context& context) -> report::Report {
        return RunEvaluate(*options, context);
      });
  AddModels(verb, *options);
  options->selection.AddTo(verb);
  AddOutputs(verb, *options);
  AddScoringOptions(verb, *options);
}

}  // namespace fdi::trainer
