#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/severity.h"
#include "diagnosis/records/growth.h"
#include "diagnosis/records/strength_point.h"
#include "storage/database/database.h"
#include "storage/history/episode.h"

namespace fdi::storage {

/// Stores strength and severity of an episode as of now. Within a transaction.
void StoreStrengthNow(Database& database, const std::string& episode_id,
                      const Estimate& now, std::optional<Severity> severity);

/// The development of the faults that name the episode, as far as its
/// `strengths` tell, in the order of its name.
std::vector<Growth> GrowthOf(const Episode& episode,
                             const std::vector<StrengthPoint>& strengths);

}  // namespace fdi::storage
