#include <cmath>
#include <iostream>

#include "diagnosis/error.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/text_table.h"
#include "storage/data_directory.h"
#include "storage/runs.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/file_runs.h"
#include "trainer/app/rescore.h"
#include "trainer/app/run_input.h"
#include "trainer/baselines/baseline.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

// The runs named for it, else those that the campaign trains on.
std::vector<TrainingRun> TrainingRuns(const EvaluateOptions& options,
                                      const cli::Context& context) {
  std::vector<storage::StoredRun> stored;
  if (options.train_runs.empty() && options.train_files.empty()) {
    if (options.selection.campaign.empty()) {
      throw ConfigError(
          "what to fit the baseline to: --train-runs ID,..., --train-file "
          "FILE.csv or a --campaign with [[run]]");
    }
    const Campaign campaign = LoadCampaign(options.selection.campaign);
    stored = LoadCampaignRuns(campaign.runs, context);
  }
  if (!options.train_runs.empty()) {
    const storage::DataDirectory directory{context.options.data_dir};
    storage::RunStore store(directory.runs());
    for (const std::string& selector : options.train_runs) {
      stored.push_back(store.Load(selector));
    }
  }
  std::optional<storage::ColumnMap> map;
  if (!options.selection.map.empty()) {
    map = cli::ReadTagMap(options.selection.map);
  }
  for (const std::string& file : options.train_files) {
    stored.push_back(ReadRunFile(file, map, kBasicSignals));
  }
  std::vector<TrainingRun> runs;
  for (const storage::StoredRun& run : stored) {
    runs.push_back(ToTrainingRun(run, options.assume_normal));
  }
  return runs;
}

// A gap, or a sample that did not reach the engine either, begins anew.
std::vector<Indication> Follow(const Baseline& baseline,
                               const storage::StoredRun& run) {
  BaselineDetector detector(baseline);
  std::vector<Indication> all;
  const std::int64_t period_ns = std::llround(run.info.run.period_s * 1e9);
  std::int64_t start_ns = 0;
  std::int64_t last_ns = 0;
  for (const storage::StoredSample& stored : run.samples) {
    if (OutOfOrder(stored.intake)) {
      continue;
    }
    const std::int64_t stamp_ns = stored.sample.stamp_ns;
    start_ns = all.empty() ? stamp_ns : start_ns;
    if (stored.intake != Intake::kAccepted ||
        (!all.empty() && 2 * (stamp_ns - last_ns) > 3 * period_ns)) {
      detector.Reset();
    }
    last_ns = stamp_ns;
    Indication indication = detector.Step(stored.sample);
    indication.time_s = static_cast<double>(stamp_ns - start_ns) * 1e-9;
    indication.truth = TruthOf(stored);
    all.push_back(std::move(indication));
  }
  return all;
}

// The table of signs, one row per signature.
void PrintTable(std::ostream& out, const Baseline& baseline) {
  if (baseline.table.empty()) {
    return;
  }
  std::vector<cli::TextTable::Column> columns;
  for (const LinearModel& model : baseline.models) {
    columns.push_back({model.name});
  }
  columns.push_back({"faults"});
  cli::TextTable table(std::move(columns));
  for (const auto& [signature, faults] : baseline.table) {
    std::vector<std::string> row;
    for (const int sign : signature) {
      row.emplace_back(sign > 0 ? "+" : sign < 0 ? "-" : "0");
    }
    row.push_back(SetText(faults));
    table.AddRow(std::move(row));
  }
  table.Print(out);
  out << '\n';
}

}  // namespace

int EvaluateBaseline(const EvaluateOptions& options,
                     const cli::Context& context) {
  const std::vector<TrainingRun> training = TrainingRuns(options, context);
  DatasetOptions dataset;
  dataset.assume_normal = options.assume_normal;
  const std::vector<Condition> conditions = BuildConditions(training, dataset);
  const Baseline baseline =
      FitBaseline(options.baseline, conditions, training.front().period_s, {});
  const std::vector<ScoredRun> runs =
      LoadScoredRuns(options.selection, kBasicSignals, context);
  std::vector<EvaluatedRun> results(runs.size());
  ParallelFor(static_cast<int>(runs.size()), 0, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    results[r] = Evaluated(runs[r], Follow(baseline, runs[r].run),
                           options.assume_normal);
  });
  if (!context.options.json && !options.csv) {
    PrintTable(std::cout, baseline);
  }
  PrintResult(options, context, {baseline.name, 0, {}}, results);
  return cli::kExitOk;
}

}  // namespace fdi::trainer
