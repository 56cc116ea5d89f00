#include "trainer/fleet/plant_files.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "base/error.h"
#include "trainer/campaign/file_runs.h"

// `mutex_` guards the map, and `loading` of each file what was read of it, so
// that files are read at the same time. Entries are never erased, and
// references to them stay valid. A thread takes `loading` under `mutex_`, never
// the other way round: Open() and TagsOf() let go of the file before they make
// room.
namespace fdi::trainer {
namespace {

// Of tables in memory [byte]: one large file, or many small ones.
constexpr std::size_t kMaxShelved = std::size_t{512} << 20U;

}  // namespace

PlantFiles::Shelved& PlantFiles::At(const std::filesystem::path& path) {
  const MutexLock lock(mutex_);
  Shelved& shelved = files_[path];
  shelved.used = ++clock_;
  return shelved;
}

// A file that could not be read is not tried again for the next row.
void PlantFiles::Load(const std::filesystem::path& path, Shelved& shelved) {
  if (!shelved.error.empty()) {
    throw DataError(shelved.error);
  }
  try {
    shelved.index =
        std::make_shared<importer::ColumnIndex>(path, form_, max_lines_);
  } catch (const std::exception& error) {
    shelved.error = error.what();
    throw DataError(shelved.error);
  }
  if (!shelved.tags) {
    shelved.tags = std::make_unique<importer::TagNames>(shelved.index->tags());
  }
}

std::shared_ptr<const importer::ColumnIndex> PlantFiles::Open(
    const std::filesystem::path& path) {
  Shelved& shelved = At(path);
  std::shared_ptr<const importer::ColumnIndex> index;
  bool loaded = false;
  {
    const MutexLock lock(shelved.loading);
    if (!shelved.index) {
      Load(path, shelved);
      loaded = true;
    }
    index = shelved.index;
  }
  if (loaded) {
    MakeRoom();
  }
  return index;
}

const importer::TagNames& PlantFiles::TagsOf(
    const std::filesystem::path& path) {
  Shelved& shelved = At(path);
  const importer::TagNames* tags = nullptr;  // Once there, they stay.
  bool loaded = false;
  {
    const MutexLock lock(shelved.loading);
    if (!shelved.tags) {
      Load(path, shelved);
      loaded = true;
    }
    tags = shelved.tags.get();
  }
  if (loaded) {
    MakeRoom();
  }
  return *tags;
}

// Lets go of the tables that were not used for longest. A table in use lives on
// with its user; one that is being loaded is passed over.
void PlantFiles::MakeRoom() {
  const MutexLock lock(mutex_);
  std::vector<Shelved*> kept;
  std::size_t bytes = 0;
  for (auto& [path, shelved] : files_) {
    if (shelved.loading.try_lock()) {
      const MutexLock loading(shelved.loading, std::adopt_lock);
      if (shelved.index) {
        bytes += shelved.index->bytes();
        kept.push_back(&shelved);
      }
    }
  }
  std::ranges::sort(kept, {}, &Shelved::used);
  for (std::size_t i = 0; i + 1 < kept.size() && bytes > kMaxShelved; ++i) {
    if (kept[i]->loading.try_lock()) {
      const MutexLock loading(kept[i]->loading, std::adopt_lock);
      if (kept[i]->index) {
        bytes -= kept[i]->index->bytes();
        kept[i]->index.reset();
      }
    }
  }
}

std::map<std::string, std::vector<std::string>> PlantFiles::AllTags() const {
  const MutexLock lock(mutex_);
  std::map<std::string, std::vector<std::string>> tags;
  for (const auto& [path, shelved] : files_) {
    const MutexLock loading(shelved.loading);
    if (shelved.tags) {
      tags[path.string()] = shelved.tags->all();
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
              PlantFiles& shelf) {
  std::string refused;
  for (const std::filesystem::path& path : files) {
    importer::TagMatch match;
    try {
      match = importer::MatchTags(job.row, shelf.TagsOf(path), path.string());
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
                                PlantFiles& shelf) {
  std::vector<PlantJob> jobs;
  for (const importer::PlantRow& row : table.rows) {
    PlantJob& job = jobs.emplace_back();
    job.row = row;
    job.error = row.error;
    if (!job.error.empty()) {
      continue;
    }
    try {
      MatchRow(job, FilesOf(row, files, folder), shelf);
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
