#include "trainer/app/evidence_runs.h"

#include <algorithm>

#include "diagnosis/fault_catalogue.h"
#include "storage/csv.h"
#include "storage/runs.h"

namespace fdi::trainer {
namespace {

std::string ScenarioOf(const LabelledEpisode& episode) {
  const storage::TrainingEpisode& meaning = episode.meaning;
  char strength[32];
  std::snprintf(strength, sizeof strength, " %.17g", meaning.strength);
  std::string text =
      "episode " + meaning.episode_id + " as " + FaultName(meaning.fault);
  if (meaning.fault != 0) {
    text += strength;
  }
  return text;
}

bool Holds(const storage::RunInfo& info, const LabelledEpisode& episode,
           const std::string& scenario) {
  return info.run.origin == storage::RunOrigin::kImported &&
         info.run.scenario == scenario && info.labels.empty() &&
         info.samples == static_cast<std::int64_t>(episode.samples.size()) &&
         info.first_stamp_ns == episode.samples.front().sample.stamp_ns &&
         info.last_stamp_ns == episode.samples.back().sample.stamp_ns;
}

std::string Store(storage::RunStore& store, const LabelledEpisode& episode,
                  const ModelSet& parent, const storage::NewRun& base) {
  storage::CsvRun part;
  part.samples = episode.samples;
  part.flow_unit = parent.flow_unit;
  part.period_s = parent.sample_period_s;
  part.has_truth = true;
  part.signals = episode.samples.front().sample.present;
  storage::CsvTable table;
  table.header.has_truth = true;
  table.header.signals = part.signals;
  table.header.flow_unit = part.flow_unit;
  table.runs.push_back(std::move(part));
  storage::NewRun row = base;
  row.valve_id = episode.meaning.valve_id;
  row.source_id = episode.samples.front().sample.source_id;
  row.start_ns = episode.samples.front().sample.stamp_ns;
  return store.Import(table, row).front();
}

}  // namespace

int KeepEvidence(std::vector<LabelledEpisode>& episodes, const ModelSet& parent,
                 const storage::DataDirectory& directory,
                 const std::string& software) {
  storage::RunStore store(directory.runs(), storage::Access::kOccasionalWriter);
  const std::vector<storage::RunInfo> known = store.List();
  int stored = 0;
  for (LabelledEpisode& episode : episodes) {
    storage::NewRun row;
    row.scenario = ScenarioOf(episode);
    row.software = software;
    const auto found = std::find_if(known.begin(), known.end(),
                                    [&](const storage::RunInfo& info) {
                                      return Holds(info, episode, row.scenario);
                                    });
    episode.meaning.run =
        found != known.end() ? found->id : Store(store, episode, parent, row);
    stored += found == known.end();
  }
  return stored;
}

}  // namespace fdi::trainer
