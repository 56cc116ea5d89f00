#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "bench/study/baseline.h"
#include "bench/study/evaluation_report.h"
#include "bench/study/model_reduction.h"
#include "bench/study/studies.h"
#include "bench/study/verbs.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer::study {
namespace {

struct ScoringOptions {
  std::string model_set;
  bool second_look{true};
  StudySelection selection;
  bool assume_normal{false};
  int seeds{0};
  std::vector<std::string> verdicts;  // Files, one per run.
  std::string baseline;               // One of BaselineNames().
  BaselineOptions fit;
  std::vector<std::string> train_runs;   // For the baseline.
  std::vector<std::string> train_files;  // For the baseline.
};

storage::ModelStore OpenModels(const report::Context& context,
                               storage::Access access) {
  const storage::DataDirectory directory{context.options.data_dir};
  return storage::ModelStore(directory.models(), access);
}

ModelSet LoadModels(const ScoringOptions& options,
                    const report::Context& context) {
  ModelSet models =
      OpenModels(context, storage::Access::kReader).Load(options.model_set);
  if (!options.second_look) {
    models.physics.clear();
  }
  return models;
}

report::Report LeftOut(const ScoringOptions& options,
                       const report::Context& context) {
  const ModelSet models = LoadModels(options, context);
  return LeaveOneOut(
      models,
      LoadScoredRuns(
          options.selection, RequiredSignals(models),
          EngineDetector(std::make_shared<const ModelSet>(models)).flow,
          context),
      {options.assume_normal});
}

report::Report Seeds(const ScoringOptions& options,
                     const report::Context& context) {
  const Detector detector = EngineDetector(
      std::make_shared<const ModelSet>(LoadModels(options, context)));
  return SeedReport(
      detector, RepeatWithSeeds(detector, options.selection, options.seeds));
}

report::Report Score(const ScoringOptions& options,
                     const report::Context& context, const Detector& detector) {
  const auto runs = LoadScoredRuns(options.selection, detector.required,
                                   detector.flow, context);
  if (!options.verdicts.empty() && runs.size() != options.verdicts.size()) {
    throw ConfigError(std::to_string(options.verdicts.size()) +
                      " files of verdicts for " + std::to_string(runs.size()) +
                      " runs: one for each is needed, in the same order");
  }
  return EvaluationReport(detector,
                          Evaluate(detector, runs, {options.assume_normal}));
}

// The runs named for the baseline, else those that the campaign trains on.
std::vector<TrainingRun> TrainingRuns(const ScoringOptions& options,
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

report::Report ScoreBaseline(const ScoringOptions& options,
                             const report::Context& context) {
  const std::vector<TrainingRun> training = TrainingRuns(options, context);
  DatasetOptions dataset;
  dataset.assume_normal = options.assume_normal;
  const Baseline baseline =
      FitBaseline(options.baseline, BuildConditions(training, dataset),
                  training.front().period_s, options.fit);
  report::Report report = Score(
      options, context, FittedBaseline(baseline, training.front().flow_unit));
  if (!baseline.table.empty()) {
    report.Heading("signatures").Line(SignatureTable(baseline));
  }
  return report;
}

using Action = report::Report (*)(const ScoringOptions&,
                                  const report::Context&);

// A verb that scores the selected runs.
CLI::App& AddVerb(report::Program& program, const char* name, const char* what,
                  Action action,
                  const std::shared_ptr<ScoringOptions>& options) {
  CLI::App& verb = program.AddVerb(
      name, what, [options, action](const report::Context& context) {
        return action(*options, context);
      });
  options->selection.AddTo(verb);
  return verb;
}

void AddModels(CLI::App& verb, ScoringOptions& options) {
  verb.add_option("--model-set", options.model_set,
                  "NAME (its active version) or NAME@VERSION")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_flag("!--no-second-look", options.second_look,
                "Score what the observers say alone");
}

void AddTruth(CLI::App& verb, ScoringOptions& options) {
  verb.add_flag("--assume-normal", options.assume_normal,
                "Samples without truth count as free of faults");
}

void AddBaselineVerb(report::Program& program) {
  const auto options = std::make_shared<ScoringOptions>();
  CLI::App& verb =
      AddVerb(program, "baseline",
              "Score a well-known detector by the indices of evaluate",
              ScoreBaseline, options);
  verb.add_option("name", options->baseline, "The detector")
      ->required()
      ->check(CLI::IsMember(BaselineNames()))
      ->type_name("NAME");
  verb.add_option("--train-runs", options->train_runs,
                  "Runs that it is fitted to (default: those that the campaign "
                  "trains on)")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--train-file", options->train_files,
                  "CSV file that it is fitted to; repeatable")
      ->expected(1)
      ->take_all()
      ->type_name("FILE.csv[@from:to]");
  verb.add_option("--false-alarms-per-hour", options->fit.false_alarms_per_hour,
                  "Rate that the limits are set for")
      ->check(CLI::Range(1e-9, 3600.0))
      ->type_name("R");
  AddTruth(verb, *options);
  program.AllowCsv(verb, "One line per run instead of tables");
}

void AddVerdictsVerb(report::Program& program) {
  const auto options = std::make_shared<ScoringOptions>();
  CLI::App& verb = AddVerb(
      program, "verdicts", "Score the files of anybody's detector",
      [](const ScoringOptions& o, const report::Context& context) {
        return Score(o, context, VerdictFiles(o.verdicts));
      },
      options);
  verb.add_option("files", options->verdicts,
                  "t_s,detected[,faults] of each run, in the order of the runs")
      ->required()
      ->delimiter(',')
      ->type_name("FILE.csv,...");
  AddTruth(verb, *options);
  program.AllowCsv(verb, "One line per run instead of tables");
}

struct ReduceOptions {
  std::string model_set;
  std::string name;
  std::vector<std::string> faults;
  std::vector<std::string> channels;
  std::vector<std::string> parts;
};

report::Report Reduce(const ReduceOptions& options,
                      const report::Context& context) {
  storage::ModelStore store =
      OpenModels(context, storage::Access::kOccasionalWriter);
  std::vector<int> faults;
  for (const std::string& name : options.faults) {
    faults.push_back(RequireFault(name));
  }
  ModelSet models = WithoutParts(
      WithoutChannels(WithoutFaults(store.Load(options.model_set), faults),
                      options.channels),
      options.parts);
  models.name = options.name;
  models = store.Save(models, storage::Activation::kAlways);
  report::Report report;
  report.document = {{"model_set", models.name}, {"version", models.version}};
  report.Line("model set " + models.name + "@" +
              std::to_string(models.version));
  return report;
}

}  // namespace

void AddScoringVerbs(report::Program& program) {
  auto options = std::make_shared<ScoringOptions>();
  CLI::App& leave = AddVerb(program, "leave-one-out",
                            "Score each fault by a set that does not know it",
                            LeftOut, options);
  AddModels(leave, *options);
  AddTruth(leave, *options);

  options = std::make_shared<ScoringOptions>();
  CLI::App& seeds = program.AddVerb(
      "seeds",
      "Repeat the simulated validation runs of a campaign with other seeds; "
      "shares with 95 % intervals, nothing is stored",
      [options](const report::Context& context) {
        return Seeds(*options, context);
      });
  AddModels(seeds, *options);
  options->selection.AddCampaignTo(seeds).required();
  seeds.add_option("count", options->seeds, "How many seeds")
      ->required()
      ->check(CLI::Range(1, 10000))
      ->type_name("N");

  AddBaselineVerb(program);
  AddVerdictsVerb(program);
  program.AddExamples(
      {{"",
        {{"Twenty seeds of the benchmark",
          "fdi-study seeds 20 --model-set benchmark --campaign "
          "campaigns/benchmark.toml"},
         {"Faults that the set does not know",
          "fdi-study leave-one-out --model-set benchmark --campaign "
          "campaigns/benchmark.toml"}}}});
}

void AddReduceVerb(report::Program& program) {
  const auto options = std::make_shared<ReduceOptions>();
  CLI::App& verb = program.AddVerb(
      "reduce",
      "Store a model set as if it had never been told of some faults, or did "
      "not have some residual channels or parts",
      [options](const report::Context& context) {
        return Reduce(*options, context);
      });
  verb.add_option("model-set", options->model_set,
                  "NAME (its active version) or NAME@VERSION")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_option("--as", options->name, "Name of the new set")
      ->required()
      ->type_name("NAME");
  verb.add_option("--without", options->faults, "These faults")
      ->delimiter(',')
      ->type_name("FAULT,...");
  verb.add_option("--without-channels", options->channels, "These channels")
      ->delimiter(',')
      ->type_name("CHANNEL,...");
  verb.add_option(
          "--without-parts", options->parts,
          "Looks by the physics, floor, limits on windows, or the early "
          "test of a name")
      ->delimiter(',')
      ->check(
          CLI::IsMember(std::vector<std::string>(kParts.begin(), kParts.end())))
      ->type_name("PART,...");
}

}  // namespace fdi::trainer::study
