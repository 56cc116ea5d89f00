#include "bench/study/scored_runs.h"

#include <utility>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "report/progress.h"
#include "report/stop_signals.h"
#include "storage/database/data_directory.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer::study {

void StudySelection::AddTo(CLI::App& verb) {
  RunSelection::AddTo(verb);
  AddCampaignTo(verb);
}

CLI::Option& StudySelection::AddCampaignTo(CLI::App& verb) {
  CLI::Option* option =
      verb.add_option("--campaign", campaign,
                      "Its validation runs; simulates or imports what is "
                      "missing")
          ->type_name("FILE.toml");
  verb.add_option("--seed-offset", seed_offset,
                  "Added to the seeds of simulated validation runs")
      ->check(CLI::Range(0, 1000000000))
      ->type_name("N");
  return *option;
}

std::vector<CampaignRun> ValidationRuns(const std::filesystem::path& path,
                                        std::uint64_t seed_offset) {
  std::vector<CampaignRun> validation = LoadCampaign(path).validation;
  if (validation.empty()) {
    throw ConfigError(path.string() + ": there is no [[validation]]");
  }
  for (CampaignRun& run : validation) {
    if (auto* simulated = std::get_if<SimulatedRun>(&run.source)) {
      simulated->scenario.config.seed += seed_offset;
    }
  }
  return validation;
}

std::vector<storage::StoredRun> LoadCampaignRuns(
    const std::vector<CampaignRun>& runs, const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  const report::StopSignals signals;
  std::optional<report::Progress> progress;  // Only if something is simulated.
  const CollectedRuns collected =
      CollectRuns(runs, directory, {context.software, NowNs(), 0},
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

std::vector<ScoredRun> LoadScoredRuns(
    const StudySelection& selection, SignalMask required,
    const std::optional<simulator::FlowTarget>& flow,
    const report::Context& context) {
  if (selection.runs.empty() && selection.files.empty() &&
      selection.campaign.empty()) {
    throw ConfigError(
        "what to score: --runs ID,..., --file FILE.csv or "
        "--campaign FILE.toml");
  }
  const importer::CsvOptions csv = selection.ForFiles(required, context);
  if (flow) {
    importer::CheckGasFlow(csv.map, simulator::MolarMass(flow->medium));
  }
  std::vector<ScoredRun> runs;
  // The order is part of the contract: files of verdicts are given in it.
  const auto add = [&](storage::StoredRun run, std::string name,
                       double horizon_s) {
    ConvertFlow(run,
                flow.value_or(simulator::FlowTarget{run.info.run.flow_unit}),
                context.log);
    runs.push_back({std::move(run), std::move(name), horizon_s, runs.size()});
  };
  // Before the campaign stores runs of its own, one of which would be `last`.
  std::vector<storage::StoredRun> given = LoadRunsAndFiles(
      selection.runs, selection.files, {context.options.data_dir}, csv);
  if (!selection.campaign.empty()) {
    const std::vector<CampaignRun> validation =
        ValidationRuns(selection.campaign, selection.seed_offset);
    std::vector<storage::StoredRun> stored =
        LoadCampaignRuns(validation, context);
    for (std::size_t i = 0; i < validation.size(); ++i) {
      add(std::move(stored[i]), RunLabel(validation[i]),
          validation[i].horizon_s);
    }
  }
  for (storage::StoredRun& run : given) {
    std::string name = RunName(run);
    add(std::move(run), std::move(name), 0.0);
  }
  return runs;
}

}  // namespace fdi::trainer::study
