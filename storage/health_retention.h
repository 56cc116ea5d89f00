#pragma once

#include "storage/retention.h"

namespace fdi::storage {

/// Deletes hours of health of history.db that ended before limits.before_ns;
/// its size is no limit here. Beside a running monitor, by short transactions
/// of one valve each.
/// @throws DataError, SqliteError as Database.
PruneResult PruneHealth(const std::filesystem::path& path,
                        const RetentionLimits& limits);

}  // namespace fdi::storage
