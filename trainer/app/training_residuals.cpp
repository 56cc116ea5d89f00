#include "trainer/app/training_residuals.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/error.h"
#include "storage/runs.h"
#include "trainer/app/run_input.h"
#include "trainer/regression.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kFewResiduals = 20;  // as the trainer has it
constexpr double kSameStrength = 1e-3;

TrainingOptions OptionsOf(const ModelSet& models) {
  try {
    return PresetOptions(models.preset);
  } catch (const ConfigError&) {
    return {};
  }
}

std::vector<storage::StoredRun> LoadRuns(
    const ModelSet& models, const storage::DataDirectory& directory,
    std::vector<std::string>& missing) {
  std::vector<storage::StoredRun> runs;
  std::optional<storage::RunStore> store;
  for (const std::string& run : models.training_runs) {
    try {
      if (!store) {
        store.emplace(directory.runs());
      }
      runs.push_back(store->Load(run));
    } catch (const std::exception& error) {
      missing.push_back("run " + run + ": " + error.what());
    }
  }
  return runs;
}

std::vector<Condition> ConditionsOf(const std::vector<storage::StoredRun>& runs,
                                    DatasetOptions options,
                                    std::vector<std::string>& missing) {
  options.assume_normal =
      options.assume_normal ||
      std::any_of(runs.begin(), runs.end(),
                  [](const storage::StoredRun& run) { return !HasTruth(run); });
  std::vector<TrainingRun> training;
  for (const storage::StoredRun& run : runs) {
    training.push_back(ToTrainingRun(run, options.assume_normal));
  }
  try {
    return BuildConditions(training, options);
  } catch (const DataError& error) {
    if (!runs.empty()) {
      missing.push_back(std::string("training data: ") + error.what());
    }
    return {};
  }
}

// The condition that the observer was trained on.
const Condition* Find(const std::vector<Condition>& conditions,
                      const Observer& observer) {
  const auto found = std::find_if(
      conditions.begin(), conditions.end(), [&](const Condition& condition) {
        return condition.fault == observer.fault &&
               std::abs(condition.strength - observer.strength) < kSameStrength;
      });
  return found == conditions.end() ? nullptr : &*found;
}

std::vector<double> ResidualsOf(const TsModel& model,
                                const Condition& condition, int settling) {
  std::vector<double> residuals =
      RunResiduals(model, condition.validation, settling);
  if (condition.fault == 0 || residuals.size() < kFewResiduals) {
    const std::vector<double> more =
        RunResiduals(model, condition.training, settling);
    residuals.insert(residuals.end(), more.begin(), more.end());
  }
  std::erase_if(residuals, [](double r) { return !std::isfinite(r); });
  return residuals;
}

}  // namespace

TrainingResiduals RepeatTrainingResiduals(
    const ModelSet& models, const storage::DataDirectory& directory) {
  TrainingResiduals result;
  const TrainingOptions options = OptionsOf(models);
  const std::vector<Condition> conditions =
      ConditionsOf(LoadRuns(models, directory, result.missing), options.dataset,
                   result.missing);
  for (const Observer& observer : models.observers) {
    const Condition* condition = Find(conditions, observer);
    std::vector<std::vector<double>> channels(observer.channels.size());
    for (std::size_t c = 0; condition != nullptr && c < channels.size(); ++c) {
      channels[c] = ResidualsOf(observer.channels[c].model, *condition,
                                options.fit.settling);
    }
    result.values.push_back(std::move(channels));
  }
  return result;
}

}  // namespace fdi::trainer
