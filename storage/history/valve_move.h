#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "storage/database/database.h"

namespace fdi::storage {

/// What of a valve's history a monitor goes on with.
struct MovedHistory {
  int accumulators{0};  ///< Beside it goes that of a candidate.
  int episodes{0};      ///< That are open, with their events and evidence.
  int shelves{0};       ///< In force.
};

/// Valves with something to move, of those whose ids match `glob`, by id.
std::vector<std::string> ValvesInProgress(Database& history,
                                          const std::string& glob);

/// Copies to `target` what the monitor of the history at `source` was at with
/// the valve; its past stays there. Twice is once: a newer accumulator and an
/// episode that is there are kept.
/// @throws SqliteError; nothing is copied then.
MovedHistory CopyProgress(Database& target, const std::filesystem::path& source,
                          const std::string& valve_id, std::int64_t now_ns);

/// Deletes what CopyProgress() copied, but for shelves, which end by
/// themselves. No monitor may run on it.
void RemoveProgress(Database& source, const std::string& valve_id);

}  // namespace fdi::storage
