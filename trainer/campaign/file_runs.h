#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/model/sample.h"
#include "import/csv.h"
#include "simulator/valve_equations.h"
#include "storage/database/data_directory.h"
#include "storage/runs/runs.h"

namespace fdi::trainer {

/// The files that `pattern` stands for, ascending: `${NAME}` is replaced by the
/// environment variable, `*` in the file's name by anything. A pattern without
/// `*` is returned as it is, whether there is such a file or not.
///
/// @param folder That relative patterns start from.
/// @throws ConfigError if a variable is not set, or nothing matches a `*`.
std::vector<std::filesystem::path> MatchingFiles(
    const std::string& pattern, const std::filesystem::path& folder);

/// The run of a table, gaps left in it, or the stretch that `selector` names by
/// seconds from its start; its id is that of the selector.
storage::StoredRun RunOf(importer::CsvTable table,
                         storage::RunSelector selector);

/// Reads a table as a run, as `fdi-store runs import` does, without storing it;
/// gaps stay in it. Its name stands for the id.
///
/// @param text `FILE.csv`, or a stretch of it, `FILE.csv@from:to` [s of t_s, or
///   from the first sample if times have a date].
/// @throws NotFoundError if there is no such file or no sample in the stretch.
/// @throws ConfigError if the stretch is none; DataError as ReadCsvFile().
storage::StoredRun ReadRunFile(const std::string& text,
                               importer::CsvOptions csv);

/// Stored runs, ID or ID@from:to, then files as ReadRunFile() reads them.
/// @throws as RunStore::Load() and ReadRunFile().
std::vector<storage::StoredRun> LoadRunsAndFiles(
    const std::vector<std::string>& runs, const std::vector<std::string>& files,
    const storage::DataDirectory& directory, const importer::CsvOptions& csv);

/// Brings the flow of a run to the unit of its valve.
/// @throws DataError as FlowConversion, naming the run.
void ConvertFlow(storage::StoredRun& run, const simulator::FlowTarget& to,
                 const LogSink& log);

}  // namespace fdi::trainer
