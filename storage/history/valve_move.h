#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "storage/database/database.h"

namespace fdi::storage {

/// The part of a valve's history that a monitor needs to continue.
struct MovedHistory {
  int accumulators{0};  ///< The candidate's is copied, too.
  int episodes{0};      ///< Open ones, with events and evidence.
  int shelves{0};       ///< In force.
};

/// Valves matching `glob` that have something to move, sorted by id.
std::vector<std::string> ValvesInProgress(Database& history,
                                          const std::string& glob);

/// Copies to `target` the state with which the monitor of the history at
/// `source` diagnosed the valve; its past stays there. Idempotent: a newer
/// accumulator and an existing episode are kept.
/// @throws SqliteError; nothing is copied then.
MovedHistory CopyProgress(Database& target, const std::filesystem::path& source,
                          const std::string& valve_id, std::int64_t now_ns);

/// Deletes what CopyProgress() copied, except shelves, which expire by
/// themselves. In a plant history the open episodes end as superseded at
/// `now_ns`. No monitor may be running on `source`.
void RemoveProgress(Database& source, const std::string& valve_id,
                    std::int64_t now_ns);

}  // namespace fdi::storage
