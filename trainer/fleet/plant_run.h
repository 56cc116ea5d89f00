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
  int shard{1};                  ///< 1..shards
  int shards{1};
  bool utc{false};               ///< Messages show times in UTC.
  OnboardingOptions onboarding;  ///< Of every row, but for name and type.
  std::function<bool()> stop{};  ///< Asked often; any thread.
};

/// What became of a row.
struct PlantOutcome {
  storage::PlantLoop loop;
  bool in_shard{true};      ///< False: it is another shard's, and was not read.
  bool unchanged{false};    ///< As it was stored before.
  std::string model_set{};  ///< NAME@VERSION; empty: none was made now.
  std::string made{};  ///< "first of its type", "from its type", "on its own"
  double seconds{0.0};
};

/// Told how much is done, 0..1, and what was done last. One thread at a time.
using PlantProgress = std::function<void(double, const std::string&)>;

/// Onboards the loops of a plant with all cores. The result of each row is
/// stored in one transaction, so that a run that was stopped at any time is
/// taken up by the next. Rows whose input has not changed since they were
/// stored are left as they are.
///
/// A row with a type and x gets a model set. Of the rows with the same type,
/// signals and units the first in the table that can be onboarded is, in full,
/// and its fitted physics become a stored type; the others take its fault
/// observers over (TransferDifferenceSet) where they are like it, and are
/// onboarded in full where not. Every other row gets a verdict of the audit.
///
/// Shards divide the rows by type, or one by one where there are fewer types
/// than shards. A shard makes the first set of a type itself where it needs it,
/// so that the sets are those of one run, bit for bit.
///
/// @throws Interrupted once settings.stop() is true; what was stored stays.
/// @throws SqliteError, DataError if the store fails.
std::vector<PlantOutcome> OnboardPlant(const std::vector<PlantJob>& jobs,
                                       PlantFiles& files,
                                       storage::ModelStore& store,
                                       const PlantSettings& settings,
                                       const PlantProgress& progress = {});

/// What can be said about the rows without storing anything: each is read as
/// far as `files` keep it, and its finding says what is wrong.
/// @param store null: there is no models.db.
std::vector<PlantOutcome> CheckPlant(const std::vector<PlantJob>& jobs,
                                     PlantFiles& files,
                                     storage::ModelStore* store,
                                     const PlantSettings& settings);

}  // namespace fdi::trainer
