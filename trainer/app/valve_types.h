#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "storage/models.h"
#include "trainer/onboarding/valve_type.h"

namespace fdi::trainer {

struct FoundType {
  ValveType type;
  bool stored{false};  ///< In models.db: made for this type, taken as it is.
};

/// The type called `name`: one stored in models.db, a shipped parameter set, or
/// what FILE.toml makes of one.
/// @throws ConfigError naming the accepted names; DataError if the stored type
///   is damaged.
FoundType FindType(const std::string& name, storage::ModelStore& store);

/// Stores the type in place of one of that name.
void SaveType(const ValveType& type, storage::ModelStore& store);

}  // namespace fdi::trainer
