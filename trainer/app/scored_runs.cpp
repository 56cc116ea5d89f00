#include "trainer/app/scored_runs.h"

#include <algorithm>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/cli/progress.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/runs.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/file_runs.h"
#include "trainer/app/rescore.h"
#include "trainer/app/run_input.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

void AddValidation(const RunSelection& selection, const cli::Context& context,
                   std::vector<ScoredRun>& runs) {
  const std::vector<CampaignRun> validation =
      ValidationRuns(selection.campaign, selection.seed_offset);
  std::vector<storage::StoredRun> stored =
      LoadCampaignRuns(validation, context);
  for (std::size_t i = 0; i < validation.size(); ++i) {
    runs.push_back({std::move(stored[i]), RunLabel(validation[i]),
                    validation[i].horizon_s});
  }
}

}  // namespace

void AddRunSelection(CLI::App& verb, RunSelection& selection) {
  verb.add_option("--runs", selection.runs, "Runs, or stretches of them [s]")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", selection.files,
                  "CSV file scored without storing it; repeatable")
      ->expected(1)
      ->take_all()
      ->type_name("FILE.csv[@from:to]");
  verb.add_option("--campaign", selection.campaign,
                  "Its validation runs; simulates or imports what is missing")
      ->type_name("FILE.toml");
  verb.add_option("--seed-offset", selection.seed_offset,
                  "Added to the seeds of simulated validation runs")
      ->check(CLI::Range(0, 1000000000))
      ->type_name("N");
  verb.add_option("--map", selection.map,
                  "TOML file: names, units, scale, offset, sense of columns")
      ->type_name("FILE.toml");
}

std::vector<storage::StoredRun> LoadCampaignRuns(
    const std::vector<CampaignRun>& runs, const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  const cli::StopSignals signals;
  std::optional<cli::Progress> progress;
  const CollectedRuns collected =
      CollectRuns(runs, directory, {context.software, cli::NowNs(), 0},
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
  std::vector<storage::StoredRun> loaded;
  for (const std::string& selector : collected.selectors) {
    loaded.push_back(store.Load(selector));
  }
  return loaded;
}

std::vector<ScoredRun> LoadScoredRuns(const RunSelection& selection,
                                      SignalMask required,
                                      const cli::Context& context) {
  if (selection.runs.empty() && selection.files.empty() &&
      selection.campaign.empty()) {
    throw ConfigError(
        "what to score: --runs ID,..., --file FILE.csv or "
        "--campaign FILE.toml");
  }
  std::vector<ScoredRun> runs;
  const auto add = [&](storage::StoredRun run) {
    std::string name = RunName(run);
    runs.push_back({std::move(run), std::move(name), 0.0});
  };
  if (!selection.campaign.empty()) {
    AddValidation(selection, context, runs);
  }
  if (!selection.runs.empty()) {
    const storage::DataDirectory directory{context.options.data_dir};
    storage::RunStore store(directory.runs());
    for (const std::string& selector : selection.runs) {
      add(store.Load(selector));
    }
  }
  std::optional<storage::ColumnMap> map;
  if (!selection.map.empty()) {
    map = cli::ReadTagMap(selection.map);
  }
  for (const std::string& file : selection.files) {
    add(ReadRunFile(file, map, required));
  }
  return runs;
}

int FaultOf(const storage::StoredRun& run) {
  const auto first = std::find_if(
      run.samples.begin(), run.samples.end(),
      [](const storage::StoredSample& s) { return TruthOf(s).fault != 0; });
  return first == run.samples.end() ? 0 : TruthOf(*first).fault;
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

EvaluatedRun Evaluated(const ScoredRun& scored,
                       const std::vector<Indication>& indications,
                       bool assume_normal) {
  EvaluatedRun result;
  result.indices = ComputeIndices(indications, scored.horizon_s);
  result.indices.run_id = scored.name;
  result.has_truth = assume_normal || HasTruth(scored.run);
  result.duration_s = DurationOf(scored.run);
  for (const Indication& indication : indications) {
    if (!indication.isolated.empty()) {
      result.last_set = indication.isolated;
    }
  }
  return result;
}

std::vector<EvaluatedRun> ScoreRuns(
    const std::shared_ptr<const ModelSet>& models,
    const std::vector<ScoredRun>& runs, bool assume_normal) {
  std::vector<EvaluatedRun> results(runs.size());
  ParallelFor(static_cast<int>(runs.size()), 0, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    results[r] =
        Evaluated(runs[r], Rescore(models, runs[r].run), assume_normal);
  });
  return results;
}

}  // namespace fdi::trainer
