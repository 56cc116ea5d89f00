#pragma once

#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "import/csv.h"
#include "import/tag_map.h"
#include "report/program.h"
#include "storage/runs/runs.h"

namespace CLI {
class App;
}

namespace fdi::trainer {

/// The runs to score, as the options of a verb name them.
struct RunSelection {
  std::vector<std::string> runs;   ///< Stored, ID or ID@from:to.
  std::vector<std::string> files;  ///< FILE.csv or FILE.csv@from:to.
  importer::TableOptions table;    ///< Describes the files.

  /// The options --runs, --file and of tables.
  void AddTo(CLI::App& verb);
  /// Options for reading files. @param required signals that a file must have.
  /// @throws ConfigError if tables are described and no file is named; as
  ///   importer::ReadTagMap().
  importer::CsvOptions ForFiles(SignalMask required,
                                const report::Context& context) const;
};

/// Loads them: the stored ones first, then files.
///
/// @param models that score them: a file must have the signals that they read,
///   and flows are converted to their unit.
/// @param more signals that a file must have.
/// @throws ConfigError if nothing is selected, NotFoundError, DataError.
std::vector<storage::StoredRun> LoadSelected(const RunSelection& selection,
                                             const ModelSet& models,
                                             const report::Context& context,
                                             SignalMask more = 0);

}  // namespace fdi::trainer
