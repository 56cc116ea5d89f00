#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "storage/database/data_directory.h"
#include "trainer/campaign/campaign.h"

namespace fdi::trainer {

/// The user asked to stop.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct CollectOptions {
  std::string software;      ///< Stored with new runs.
  std::int64_t start_ns{0};  ///< For runs whose scenario does not say it.
  int threads{0};            ///< 0: all of the machine.
};

struct CollectedRuns {
  std::vector<std::string> selectors;  ///< In the order asked for.
  int simulated{0};                    ///< New in runs.db.
  int imported{0};                     ///< New in runs.db.
  int reused{0};  ///< Simulated or imported before, by the same software.
};

/// Called with the share of the work done, 0..1, and what is done now. It may
/// throw to stop the work. Called from one thread at a time.
using CollectProgress = std::function<void(double, const std::string&)>;

/// Finds the runs of a campaign that runs.db has, imports files and simulates
/// the others on all cores. Every new run is stored in one transaction when it
/// is complete.
///
/// @throws NotFoundError, DataError, ConfigError naming run or file; nothing
///   is simulated before all files and recorded runs were found.
CollectedRuns CollectRuns(const std::vector<CampaignRun>& runs,
                          const storage::DataDirectory& directory,
                          const CollectOptions& options,
                          const CollectProgress& progress = {});

/// Simulates a run in memory; its id stays empty.
storage::StoredRun SimulateRun(const SimulatedRun& run);

}  // namespace fdi::trainer
