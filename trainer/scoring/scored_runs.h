#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "import/csv.h"
#include "import/tag_map.h"
#include "report/program.h"
#include "simulator/valve_equations.h"
#include "storage/runs/runs.h"

namespace CLI {
class App;
}

namespace fdi::trainer {

/// Which runs are scored, as the options of a verb name them.
struct RunSelection {
  std::vector<std::string> runs;   ///< Stored, ID or ID@from:to.
  std::vector<std::string> files;  ///< FILE.csv or FILE.csv@from:to.
  std::filesystem::path campaign;  ///< Its validation runs; empty: none.
  std::uint64_t seed_offset{0};    ///< Added to the seeds of the campaign.
  importer::TableOptions table;    ///< Of files.

  /// The options --runs, --file, --campaign, --seed-offset and of tables.
  void AddTo(CLI::App& verb);
  /// How files are read. @param required signals that a file must have.
  /// @throws as importer::ReadTagMap().
  importer::CsvOptions ForFiles(SignalMask required,
                                const report::Context& context) const;
};

/// A run to score, under the name that results list it by.
struct ScoredRun {
  storage::StoredRun run;
  std::string name;
  double horizon_s{0.0};    ///< Of CampaignRun.
  std::size_t position{0};  ///< Among the runs that were selected.
};

/// Loads them: first those of the campaign, then the stored ones, then files.
/// What the campaign simulates or imports is stored in runs.db.
///
/// @param required signals that a file must have.
/// @param flow that flows are converted to; nothing: as they are.
/// @throws ConfigError if nothing is selected, NotFoundError, DataError.
std::vector<ScoredRun> LoadScoredRuns(
    const RunSelection& selection, SignalMask required,
    const std::optional<simulator::FlowTarget>& flow,
    const report::Context& context);

}  // namespace fdi::trainer
