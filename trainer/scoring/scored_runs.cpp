#include "trainer/scoring/scored_runs.h"

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "storage/database/data_directory.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer {

void RunSelection::AddTo(CLI::App& verb) {
  verb.add_option("--runs", runs, "Runs, or stretches of them [s]")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", files,
                  "CSV file scored without storing it; repeatable")
      ->expected(1)
      ->take_all()
      ->type_name("FILE.csv[@from:to]");
  verb.add_option("--campaign", campaign,
                  "Its validation runs; simulates or imports what is missing")
      ->type_name("FILE.toml");
  verb.add_option("--seed-offset", seed_offset,
                  "Added to the seeds of simulated validation runs")
      ->check(CLI::Range(0, 1000000000))
      ->type_name("N");
  table.AddTo(verb);
}

importer::CsvOptions RunSelection::ForFiles(
    SignalMask required, const report::Context& context) const {
  return {.map = table.Read(context.options.utc),
          .required = required,
          .log = context.log};
}

std::vector<ScoredRun> LoadScoredRuns(
    const RunSelection& selection, SignalMask required,
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
  const auto add = [&](storage::StoredRun run, std::string name = "",
                       double horizon_s = 0.0) {
    ConvertFlow(run,
                flow.value_or(simulator::FlowTarget{run.info.run.flow_unit}),
                context.log);
    name = name.empty() ? RunName(run) : std::move(name);
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
    add(std::move(run));
  }
  return runs;
}

}  // namespace fdi::trainer
