#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "storage/database/database.h"

namespace fdi::storage {

inline constexpr std::int32_t kHistoryApplicationId = 0x46444948;  // "FDIH"

/// Schema of history.db: tables episode, episode_fault, episode_event,
/// event_outbox, episode_trace, monitor_session, data_gap and the view
/// fault_history; see docs/data.md. Times in tables are INTEGER ns UTC; the
/// *_utc columns of the view are RFC 3339 text with milliseconds, such as
/// 2026-11-20T14:56:11.000Z, so that they sort as they read. An episode id is
/// TEXT, 16 lower-case hex digits. Other 64-bit masks and hashes are INTEGER
/// with the same bits.
const Schema& HistorySchema();

/// Resolves a unique id prefix, or "last" for the newest episode.
/// @throws NotFoundError
std::uint64_t ResolveEpisode(Database& database, std::string_view id);

}  // namespace fdi::storage
