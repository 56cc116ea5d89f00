#pragma once

#include <filesystem>
#include <string>

#include "base/text.h"
#include "trainer/campaign/campaign_runs.h"

namespace fdi::trainer {

/// Simulates the validation runs of a campaign and stores them in a data
/// directory. @returns their ids for --runs, in their order.
inline std::string StoreValidationRuns(const std::filesystem::path& campaign,
                                       const std::filesystem::path& data) {
  return JoinText(
      CollectRuns(LoadCampaign(campaign).validation, {data}, {}).selectors,
      ",");
}

}  // namespace fdi::trainer
