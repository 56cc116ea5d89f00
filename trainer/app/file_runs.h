#pragma once

#include <optional>
#include <string>

#include "diagnosis/sample.h"
#include "storage/csv.h"
#include "storage/run_types.h"

namespace fdi::trainer {

/// Reads a CSV file as a run, as `fdi-store runs import` does, without storing
/// it. Its name stands for the id.
///
/// @param text `FILE.csv`, or a stretch of it, `FILE.csv@from:to` [s of t_s].
/// @param required signals that must be there (CsvOptions::required).
/// @throws NotFoundError if there is no such file or no sample in the stretch.
/// @throws ConfigError if the stretch is none; DataError as ReadCsvFile().
storage::StoredRun ReadRunFile(const std::string& text,
                               const std::optional<storage::ColumnMap>& map,
                               SignalMask required);

}  // namespace fdi::trainer
