#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/records/growth.h"
#include "diagnosis/records/strength_point.h"
#include "storage/database/database.h"
#include "storage/history/episode.h"

namespace fdi::storage {

/// Within a transaction; that of the same fault and stamp is replaced.
/// @throws NotFoundError if there is no such episode.
void StoreStrength(Database& database, const StrengthPoint& point);

/// By stamp. @throws DataError for a fault or a layer that is none.
std::vector<StrengthPoint> ReadStrengths(Database& database,
                                         std::uint64_t episode_id);

/// How the faults that name the episode develop, as far as `strengths` of it
/// tell, in the order of its name.
std::vector<Growth> GrowthOf(const Episode& episode,
                             const std::vector<StrengthPoint>& strengths);

}  // namespace fdi::storage
