#pragma once

#include <vector>

#include "diagnosis/records/growth.h"
#include "diagnosis/records/strength_point.h"
#include "storage/history/episode.h"

namespace fdi::storage {

/// How the faults that name the episode develop, as far as `strengths` of it
/// tell, in the order of its name.
std::vector<Growth> GrowthOf(const Episode& episode,
                             const std::vector<StrengthPoint>& strengths);

}  // namespace fdi::storage
