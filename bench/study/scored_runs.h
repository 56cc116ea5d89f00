#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "simulator/valve_equations.h"
#include "trainer/campaign/campaign.h"
#include "trainer/scoring/scored_runs.h"

namespace CLI {
class Option;
}

namespace fdi::trainer::study {

/// Which runs are scored: those of a campaign, too.
struct StudySelection : RunSelection {
  std::filesystem::path campaign;  ///< Its validation runs; empty: none.
  std::uint64_t seed_offset{0};    ///< Added to the seeds of the campaign.

  /// The options of RunSelection, --campaign and --seed-offset.
  void AddTo(CLI::App& verb);
  /// --campaign and --seed-offset.
  CLI::Option& AddCampaignTo(CLI::App& verb);
};

/// A run to score, under the name that results list it by.
struct ScoredRun {
  storage::StoredRun run;
  std::string name;
  double horizon_s{0.0};    ///< CampaignRun's.
  std::size_t position{0};  ///< Among the runs that were selected.
};

/// The [[validation]] of a campaign; `seed_offset` is added to the seeds of
/// simulated runs. @throws as LoadCampaign(), or ConfigError if it has none.
std::vector<CampaignRun> ValidationRuns(const std::filesystem::path& path,
                                        std::uint64_t seed_offset);

/// Finds, imports or simulates the runs of a campaign with a progress bar, and
/// loads them all. @throws as CollectRuns(), or Interrupted.
std::vector<storage::StoredRun> LoadCampaignRuns(
    const std::vector<CampaignRun>& runs, const report::Context& context);

/// Loads them: first those of the campaign, then the stored ones, then files.
/// Runs that the campaign simulates or imports are stored in runs.db.
///
/// @param required signals that a file must have.
/// @param flow that flows are converted to; nothing: as they are.
/// @throws ConfigError if nothing is selected, NotFoundError, DataError.
std::vector<ScoredRun> LoadScoredRuns(
    const StudySelection& selection, SignalMask required,
    const std::optional<simulator::FlowTarget>& flow,
    const report::Context& context);

}  // namespace fdi::trainer::study
