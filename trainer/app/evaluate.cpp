#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/verbs.h"
#include "trainer/baselines/baseline.h"

namespace fdi::trainer {
namespace {

int Evaluate(const EvaluateOptions& options, const cli::Context& context) {
  if (options.csv && context.options.json) {
    throw ConfigError("either --json or --csv");
  }
  if (!options.selection.map.empty() && options.selection.files.empty() &&
      options.train_files.empty() && options.history.empty()) {
    throw ConfigError("--map is of --file, --train-file or --history");
  }
  if (options.leave_one_out) {
    return EvaluateLeaveOneOut(options, context);
  }
  if (options.seeds > 0) {
    return EvaluateSeeds(options, context);
  }
  if (!options.verdicts.empty()) {
    return EvaluateVerdicts(options, context);
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
  verb.add_flag("--assume-normal", options.assume_normal,
                "What has no truth counts as free of faults");
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

// What scores otherwise; each excludes the others and the outputs it lacks.
void AddWays(CLI::App& verb, EvaluateOptions& options) {
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
                      "Score a detector that readers know, fitted to the "
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

void AddEvaluateVerb(cli::Program& program) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App& verb = program.AddVerb(
      "evaluate",
      "Score runs with the monitor's engine: indices, confusion matrix, report",
      [options](const cli::Context& context) {
        return Evaluate(*options, context);
      });
  AddModels(verb, *options);
  AddRunSelection(verb, options->selection);
  AddOutputs(verb, *options);
  AddWays(verb, *options);
}

}  // namespace fdi::trainer
