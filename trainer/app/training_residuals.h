#pragma once

#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/data_directory.h"

namespace fdi::trainer {

/// Residuals that the memberships of a model set came from, computed anew.
struct TrainingResiduals {
  /// By observer and channel [unit of the output]; empty where there are none.
  std::vector<std::vector<std::vector<double>>> values;
  /// Runs of ModelSet::training_runs that could not be read, and why.
  std::vector<std::string> missing;
};

/// Runs every model over the data of its condition: of a fault the validation
/// stretches, all stretches where those are short; of normal operation all
/// stretches (its membership rests on cross-validation over them). Stretches
/// are cut as the preset of the set says; a campaign may have said otherwise.
TrainingResiduals RepeatTrainingResiduals(
    const ModelSet& models, const storage::DataDirectory& directory);

}  // namespace fdi::trainer
