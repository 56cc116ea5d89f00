#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "storage/cli/program.h"
#include "storage/run_types.h"
#include "trainer/app/campaign.h"
#include "trainer/app/evaluated_run.h"

namespace CLI {
class App;
}

namespace fdi::trainer {

/// Which runs are scored, as the options of `evaluate` name them.
struct RunSelection {
  std::vector<std::string> runs;   ///< Stored, ID or ID@from:to.
  std::vector<std::string> files;  ///< FILE.csv or FILE.csv@from:to.
  std::filesystem::path campaign;  ///< Its validation runs; empty: none.
  std::uint64_t seed_offset{0};    ///< Added to the seeds of the campaign.
  std::filesystem::path map;       ///< Of the columns of files.
};

/// --runs, --file, --campaign, --seed-offset, --map.
void AddRunSelection(CLI::App& verb, RunSelection& selection);

/// A run to score, under the name it is listed by.
struct ScoredRun {
  storage::StoredRun run;
  std::string name;
  double horizon_s{0.0};
};

/// Loads them: first those of the campaign, then the stored ones, then files.
/// What the campaign simulates or imports is stored in runs.db.
///
/// @param required signals that a file must have.
/// @throws ConfigError if nothing is selected, NotFoundError, DataError.
std::vector<ScoredRun> LoadScoredRuns(const RunSelection& selection,
                                      SignalMask required,
                                      const cli::Context& context);

/// The runs of a campaign, in its order; simulates or imports what runs.db does
/// not have, with a progress bar. @throws as CollectRuns(), or Interrupted.
std::vector<storage::StoredRun> LoadCampaignRuns(
    const std::vector<CampaignRun>& runs, const cli::Context& context);

/// The indices of one run from what was said about it; without a truth it is
/// not counted unless `assume_normal`.
EvaluatedRun Evaluated(const ScoredRun& scored,
                       const std::vector<Indication>& indications,
                       bool assume_normal);

/// The first fault that acts in a run; 0: none does.
int FaultOf(const storage::StoredRun& run);

/// From the first to the last sample and one period more [s].
double DurationOf(const storage::StoredRun& run);

/// Scores every run with the monitor's engine, on all cores.
std::vector<EvaluatedRun> ScoreRuns(
    const std::shared_ptr<const ModelSet>& models,
    const std::vector<ScoredRun>& runs, bool assume_normal);

}  // namespace fdi::trainer
