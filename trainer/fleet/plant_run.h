#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "storage/models/plant_loops.h"
#include "trainer/fleet/plant_files.h"
#include "trainer/fleet/plant_rows.h"
#include "trainer/onboarding/onboarding.h"

namespace fdi::trainer {

struct PlantSettings {
  std::filesystem::path folder;  ///< That files and types of rows start from.
  int jobs{0};                   ///< Rows at a time; 0: one per core.
  bool utc{false};               ///< Messages show times in UTC.
  OnboardingOptions onboarding;  ///< For every row, except name and type.
  std::function<bool()> stop{};  ///< Asked often; any thread.
};

/// The result of a row.
struct PlantOutcome {
  storage::PlantLoop loop;
  bool unchanged{false};    ///< As it was stored before.
  std::string model_set{};  ///< NAME@VERSION; empty: none was made now.
  double seconds{0.0};
};

/// Told how much is done, 0..1, and what was done last. One thread at a time.
using PlantProgress = std::function<void(double, const std::string&)>;

/// Onboards the rows of a plant's table one by one, each as
/// `onboard --valve` does; a row without a type or without x gets a verdict of
/// the audit. The result of each row is stored in one transaction, so that the
/// next run goes on where one was stopped. A row whose fingerprint,
/// InputHash(), is the one that it was stored with is left as it is.
///
/// @returns an outcome for each job. A row that cannot be used has the state
///   kRefused and says why; the others go on.
/// @throws Interrupted once settings.stop() is true; what was stored stays.
/// @throws SqliteError, DataError if the store fails.
std::vector<PlantOutcome> OnboardPlant(const std::vector<PlantJob>& jobs,
                                       PlantFiles& files,
                                       storage::ModelStore& store,
                                       const PlantSettings& settings,
                                       const PlantProgress& progress = {});

/// Checks the rows without storing anything: each is read as
/// far as `files` keep it, and its finding says what is wrong.
/// @param store null: there is no models.db.
std::vector<PlantOutcome> CheckPlant(const std::vector<PlantJob>& jobs,
                                     PlantFiles& files,
                                     storage::ModelStore* store,
                                     const PlantSettings& settings);

}  // namespace fdi::trainer
