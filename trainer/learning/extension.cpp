#include "trainer/learning/extension.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "simulator/second_look/valve_physics.h"
#include "storage/runs/runs.h"
#include "trainer/learning/label_plan.h"

namespace fdi::trainer {
namespace {

// The levels stand for what a valve does not measure; onboarding simulated them
// and kept them as the mean readings.
ValveType TypeOf(const ModelSet& models, std::string name) {
  if (models.physics.empty()) {
    throw DataError("model set " + NameOf(models) +
                    " holds no physical parameters: it is of `fdi-trainer "
                    "train`, onboard the valve");
  }
  const simulator::ValvePhysics physics =
      simulator::PhysicsFrom(models.physics);
  ValveType type;
  type.name = std::move(name);
  type.parameters = physics.parameters;
  type.interpolated_command = physics.drive.interpolated_command;
  type.command_delay = physics.drive.command_delay;
  type.levels.p1_kpa = physics.p1.mean;
  type.levels.p2_kpa = physics.p2.mean;
  type.levels.t1_degc = physics.t1.mean;
  return type;
}

// DAY.csv@0:1500 of /records/DAY.csv@0:1500
std::string WithoutFolders(const std::string& file) {
  return std::filesystem::path(file).filename().string();
}

bool IsFile(const std::string& text) {
  return std::filesystem::exists(text) ||
         std::filesystem::exists(text.substr(0, text.rfind('@')));
}

// The file where it was, or as the user names it; it is then no new one.
std::optional<std::string> FindFile(const std::string& former,
                                    std::vector<std::string>& files) {
  const auto given =
      std::ranges::find(files, WithoutFolders(former), WithoutFolders);
  if (given != files.end()) {
    std::string found = *given;
    files.erase(given);
    return found;
  }
  return IsFile(former) ? std::optional(former) : std::nullopt;
}

bool IsRun(const std::string& run, const storage::DataDirectory& directory) {
  if (!std::filesystem::exists(directory.runs())) {
    return false;
  }
  try {
    storage::RunStore(directory.runs()).Info(run);
    return true;
  } catch (const std::runtime_error&) {
    return false;  // A path, or a run that was deleted.
  }
}

}  // namespace

FormerRecord ReadFormerRecord(const std::string& valve, const LabelPlan& labels,
                              const storage::DataDirectory& directory,
                              std::vector<std::string>& files) {
  storage::ModelStore store(directory.models());
  const ModelSet& models = *labels.parent;
  FormerRecord record;
  const auto entry = store.FindValve(valve);
  record.type = TypeOf(models, entry ? entry->type : valve);
  record.signals = entry ? entry->signals : kBasicSignals;
  const auto is_evidence = [&](const std::string& run) {
    return std::ranges::find(labels.lineage.episodes, run,
                             &storage::TrainingEpisode::run) !=
           labels.lineage.episodes.end();
  };
  for (const std::string& run : FirstSet(models, store).training_runs) {
    if (is_evidence(run)) {
      continue;
    }
    if (IsRun(run, directory)) {
      record.runs.push_back(run);
    } else if (const auto file = FindFile(run, files)) {
      record.files.push_back(*file);
    } else {
      throw NotFoundError(
          "the record " + run + " that model set " + NameOf(models) +
          " was made from is gone: give its file with --file, or onboard the "
          "valve anew with all that is there");
    }
  }
  for (const storage::TrainingEpisode& episode : labels.lineage.episodes) {
    if (episode.fault == 0 &&
        std::ranges::find(labels.runs, episode.run) != labels.runs.end()) {
      record.runs.push_back(episode.run);
    }
  }
  return record;
}

}  // namespace fdi::trainer
