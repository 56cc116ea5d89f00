#pragma once

#include "storage/retention.h"

namespace fdi::storage {

/// Deletes stretches of shadow_difference that ended before limits.before_ns;
/// their size is no limit here. Beside a running monitor, by short
/// transactions.
/// @throws DataError, SqliteError as Database.
PruneResult PruneShadow(const std::filesystem::path& path,
                        const RetentionLimits& limits);

}  // namespace fdi::storage
