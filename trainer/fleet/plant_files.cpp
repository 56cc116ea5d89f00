#include "trainer/fleet/plant_files.h"

#include <exception>
#include <utility>

#include "base/error.h"
#include "trainer/campaign/file_runs.h"

namespace fdi::trainer {
namespace {

// Enough for one large export, or for many small ones [byte].
constexpr std::size_t kMaxKept = std::size_t{512} << 20U;

}  // namespace

// A file that could not be read is not tried again for the next row.
std::shared_ptr<const importer::ColumnIndex> PlantFiles::Read(
    const std::filesystem::path& path, File& file) {
  if (!file.error.empty()) {
    throw DataError(file.error);
  }
  if (file.index) {
    return file.index;
  }
  std::shared_ptr<const importer::ColumnIndex> index;
  try {
    index = std::make_shared<importer::ColumnIndex>(path, form_, max_lines_);
  } catch (const std::exception& error) {
    file.error = error.what();
    throw DataError(file.error);
  }
  if (!file.tags) {
    file.tags = std::make_unique<importer::TagNames>(index->tags());
  }
  if (kept_bytes_ + index->bytes() <= kMaxKept) {
    kept_bytes_ += index->bytes();
    file.index = index;
  }
  return index;
}

std::shared_ptr<const importer::ColumnIndex> PlantFiles::Open(
    const std::filesystem::path& path) {
  const MutexLock lock(mutex_);
  return Read(path, files_[path]);
}

const importer::TagNames& PlantFiles::TagsOf(
    const std::filesystem::path& path) {
  const MutexLock lock(mutex_);
  File& file = files_[path];
  if (!file.tags) {
    Read(path, file);
  }
  return *file.tags;
}

std::map<std::string, std::vector<std::string>> PlantFiles::AllTags() const {
  const MutexLock lock(mutex_);
  std::map<std::string, std::vector<std::string>> tags;
  for (const auto& [path, file] : files_) {
    if (file.tags) {
      tags[path.string()] = file.tags->all();
    }
  }
  return tags;
}

namespace {

std::vector<std::filesystem::path> FilesOf(
    const importer::PlantRow& row,
    const std::vector<std::filesystem::path>& files,
    const std::filesystem::path& folder) {
  if (row.file.empty()) {
    if (files.empty()) {
      throw ConfigError(
          "no file has its record; type files = [...] at the top of the table, "
          "file in the row, or --file");
    }
    return files;
  }
  return MatchingFiles(row.file, folder);
}

// A file in which op is not found is of other loops, unless it is the only one.
void MatchRow(PlantJob& job, const std::vector<std::filesystem::path>& files,
              PlantFiles& plant_files) {
  std::string refused;
  for (const std::filesystem::path& path : files) {
    importer::TagMatch match;
    try {
      match =
          importer::MatchTags(job.row, plant_files.TagsOf(path), path.string());
    } catch (const DataError& error) {
      refused = error.what();
      continue;
    }
    const bool has_op = !match[importer::LoopTag::kOp].empty();
    if (!match.error.empty() && (refused.empty() || has_op)) {
      refused = match.error;
      job.unmatched = match.unmatched;
      job.ambiguous = match.ambiguous;
    }
    if (!has_op && match.ambiguous.empty()) {
      continue;
    }
    if (!match.error.empty()) {
      job.error = match.error;
      return;
    }
    job.unmatched = match.unmatched;
    job.sources.push_back({path, std::move(match)});
  }
  if (job.sources.empty()) {
    job.error = refused;
  }
}

}  // namespace

std::vector<PlantJob> MatchRows(const importer::PlantTable& table,
                                const std::vector<std::filesystem::path>& files,
                                const std::filesystem::path& folder,
                                PlantFiles& plant_files) {
  std::vector<PlantJob> jobs;
  for (const importer::PlantRow& row : table.rows) {
    PlantJob& job = jobs.emplace_back();
    job.row = row;
    job.error = row.error;
    if (!job.error.empty()) {
      continue;
    }
    try {
      MatchRow(job, FilesOf(row, files, folder), plant_files);
    } catch (const ConfigError& error) {
      job.error = error.what();
    }
    if (job.error.empty()) {
      const importer::TagMatch& match = job.sources.front().match;
      for (std::size_t i = 0; i < importer::kLoopTagCount; ++i) {
        if (!match.columns[i].empty()) {
          job.matched.push_back(std::string(importer::LoopTagName(
                                    static_cast<importer::LoopTag>(i))) +
                                " = " + match.columns[i]);
        }
      }
    }
  }
  return jobs;
}

}  // namespace fdi::trainer
