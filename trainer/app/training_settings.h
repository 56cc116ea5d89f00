#pragma once

#include <string>

#include "storage/lineage.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The settings of a training that its model set does not hold, as JSON: kept
/// with the set, so that the next version is made as this one was.
std::string SettingsText(const TrainingOptions& options);

/// How the set was trained: its preset with its own decision parameters, false
/// alarm rate and, where its lineage tells them, settings.
/// @throws DataError if the set was not made by `fdi-trainer train`.
TrainingOptions OptionsOf(const ModelSet& models,
                          const storage::Lineage& lineage);

}  // namespace fdi::trainer
