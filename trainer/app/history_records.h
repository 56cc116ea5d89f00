#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/csv.h"
#include "trainer/app/back_test.h"

namespace fdi::trainer {

/// The files of one valve in order of time.
struct ValveFiles {
  std::string valve;
  std::vector<std::filesystem::path> files;
};

/// The CSV files of `pattern` by valve: of a folder those in it and in its
/// folders; or a path with * in the file's name. A file belongs to `valve`, or
/// where that is empty to the valve that its folder is named after.
/// @throws NotFoundError if there is none; ConfigError as MatchingFiles().
std::vector<ValveFiles> FindHistory(const std::string& pattern,
                                    const std::string& valve);

/// UTC of t_s = 0 from the name of a file: a date YYYY-MM-DD, alone or with
/// THHMM, THHMMSS or THH:MM:SS behind it; nothing if there is none.
std::optional<std::int64_t> StartInName(const std::filesystem::path& file);

/// Told the name of a file before it is read.
using FileSink = std::function<void(const std::filesystem::path&)>;

/// Feeds the files of a valve to one engine, sample by sample, and keeps the
/// episodes. Where the stamps of a file go on one period after those of the
/// file before, so does the engine; it meets a gap where they do not. Without a
/// date in the names, t_s is the time axis.
///
/// @throws DataError naming the file if it lacks a signal of the model set or
///   has its flow in another unit, or begins before the end of the file before.
PastRecord FollowHistory(const ValveFiles& files,
                         const std::shared_ptr<const ModelSet>& models,
                         const std::optional<storage::ColumnMap>& map,
                         const FileSink& progress = {});

}  // namespace fdi::trainer
