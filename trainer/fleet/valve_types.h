#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "diagnosis/model/model_set.h"
#include "storage/models/plant_loops.h"
#include "trainer/onboarding/fault_synthesis.h"
#include "trainer/onboarding/onboarding.h"

namespace fdi::trainer {

struct FoundType {
  ValveType type;
  bool stored{false};       ///< In models.db: made for this type, as it is.
  std::string model_set{};  ///< Set of the valve it came from, NAME@VERSION.
  std::string set_hash{};   ///< Content hash of that set; empty: not known.
};

/// The type called `name`: one stored in models.db, a shipped parameter set, or
/// the parameters in FILE.toml.
/// @param store null: there is no models.db.
/// @param folder that relative files start from.
/// @throws ConfigError naming the accepted names.
FoundType FindType(const std::string& name, storage::ModelStore* store,
                   const std::filesystem::path& folder = {});

/// The model set that the type was saved with; nothing if it is not there any
/// more.
std::optional<ModelSet> SetOf(const FoundType& found,
                              storage::ModelStore& store);

/// The text that a type is stored as: a scenario in TOML.
std::string TypeText(const ValveType& type, const ModelSet* models = nullptr);

/// The onboarding of a valve, for ModelStore::Store().
/// @param type_name that its fitted type is saved as; empty: it is not saved.
storage::ValveResult ResultOf(const std::string& valve,
                              const Onboarding& onboarding,
                              const std::string& type_name);

}  // namespace fdi::trainer
