#pragma once

#include <vector>

#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

// What a monitor finds when it starts: see HistoryWriter.

/// In the order of commitment.
std::vector<UnsentEvent> ReadUnsentEvents(Database& database);
/// Episodes that have not ended, by detection.
std::vector<Episode> ReadOpenEpisodes(Database& database);

}  // namespace fdi::storage
