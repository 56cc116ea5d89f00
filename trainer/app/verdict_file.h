#pragma once

#include <filesystem>
#include <vector>

#include "storage/run_types.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// What another detector said about the samples of `run`, from a CSV file with
/// the columns t_s, detected (0 or 1) and, if it isolates, faults (f3|f6, empty
/// for none). t_s counts as in the file of the run, or as
/// `fdi-store runs export` writes a stored one. Every sample has a row; rows
/// outside the run are left alone. Nothing is smoothed or dated back, and the
/// detector counts as settled from its first row on.
///
/// @throws NotFoundError if there is no such file; DataError naming file, line
///   and reason: a column is missing, t_s does not rise, a cell that is not
///   what it should be, faults without a detection, a sample without a row.
std::vector<Indication> ReadVerdicts(const std::filesystem::path& file,
                                     const storage::StoredRun& run);

}  // namespace fdi::trainer
