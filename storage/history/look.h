#pragma once

#include <cstdint>
#include <optional>

#include "diagnosis/records/episode_look.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Within a transaction: replaces what is stored of an earlier look.
/// @throws NotFoundError if there is no such episode.
void StoreLook(Database& database, const EpisodeLook& look);

/// Nothing if no second look at the episode had an answer.
/// @throws DataError for a fault without a name.
std::optional<EpisodeLook> ReadLook(Database& database,
                                    std::uint64_t episode_id);

}  // namespace fdi::storage
