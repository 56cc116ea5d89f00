#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

// What reader, editor and writer of history.db have in common.

/// Columns for ReadEpisode(), of `fault_history v JOIN episode e`.
extern const char* const kEpisodeColumns;

/// The episode in the current row of a query for kEpisodeColumns.
Episode ReadEpisode(const Statement& row);

/// "a|b" to {"a", "b"}; {} for "".
std::vector<std::string> SplitNames(std::string_view joined);
std::string JoinNames(const std::vector<std::string>& names);

/// The names of `faults`, whose bits index `names`; "" for the empty set.
std::string NamesOf(FaultSet faults, const std::vector<std::string>& names);

/// The one episode whose id begins with `id`, or the newest for "last".
/// @throws NotFoundError
std::uint64_t ResolveEpisode(Database& database, std::string_view id);

}  // namespace fdi::storage
