#include "trainer/scoring/scored_runs.h"

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "simulator/second_look/valve_physics.h"
#include "storage/database/data_directory.h"
#include "trainer/campaign/file_runs.h"

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
  table.AddTo(verb);
}

importer::CsvOptions RunSelection::ForFiles(
    SignalMask required, const report::Context& context) const {
  if (table.given() && files.empty()) {
    throw ConfigError("--map, --zone and --resample describe a --file");
  }
  return {.map = table.Read(context.options.utc),
          .required = required,
          .log = context.log};
}

std::vector<storage::StoredRun> LoadSelected(const RunSelection& selection,
                                             const ModelSet& models,
                                             const report::Context& context,
                                             SignalMask more) {
  if (selection.runs.empty() && selection.files.empty()) {
    throw ConfigError("what to score: --runs ID,... or --file FILE.csv");
  }
  const importer::CsvOptions csv =
      selection.ForFiles(RequiredSignals(models) | more, context);
  const simulator::FlowTarget flow = simulator::FlowTargetOf(models);
  importer::CheckGasFlow(csv.map, simulator::MolarMass(flow.medium));
  std::vector<storage::StoredRun> runs = LoadRunsAndFiles(
      selection.runs, selection.files, {context.options.data_dir}, csv);
  for (storage::StoredRun& run : runs) {
    ConvertFlow(run, flow, context.log);
  }
  return runs;
}

}  // namespace fdi::trainer
