#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "import/column_index.h"
#include "import/plant_table.h"

namespace fdi::trainer {

/// The files of a plant. Tables stay in memory for the rows to come until they
/// take 512 MB; a file beyond that is read again for each row. Thread safe.
class PlantFiles {
 public:
  /// @param form as the user states it. @param max_lines of each file; 0: all.
  PlantFiles(importer::ColumnMap form, std::size_t max_lines)
      : form_(std::move(form)), max_lines_(max_lines) {}

  /// The table in `path`. @throws as importer::ColumnIndex, each time.
  std::shared_ptr<const importer::ColumnIndex> Open(
      const std::filesystem::path& path);
  /// Its tags. @throws likewise.
  const importer::TagNames& TagsOf(const std::filesystem::path& path);
  /// The tags of all files that were read, by file.
  std::map<std::string, std::vector<std::string>> AllTags() const;

 private:
  struct File {
    std::shared_ptr<const importer::ColumnIndex> index;  // Null: not kept.
    std::unique_ptr<importer::TagNames> tags;
    std::string error;  // Why it cannot be read; empty: it can.
  };
  std::shared_ptr<const importer::ColumnIndex> Read(
      const std::filesystem::path& path, File& file) REQUIRES(mutex_);

  importer::ColumnMap form_;
  std::size_t max_lines_;
  mutable Mutex mutex_;
  // Entries are never erased, and references to their tags stay valid.
  std::map<std::filesystem::path, File> files_ GUARDED_BY(mutex_);
  std::size_t kept_bytes_ GUARDED_BY(mutex_){0};
};

/// Where the record of a row is: a file and its columns.
struct RowSource {
  std::filesystem::path path;
  importer::TagMatch match;
};

/// A row of the table, matched with the files.
struct PlantJob {
  importer::PlantRow row;
  std::vector<RowSource> sources;
  std::vector<std::string> matched;  ///< "op = FIC101.OP"
  std::vector<std::string> unmatched;
  std::vector<std::string> ambiguous;
  std::string error;  ///< Empty: none.
};

/// Matches each row with the files of its own or of the table.
/// @param files patterns; relative ones start from `folder`.
std::vector<PlantJob> MatchRows(const importer::PlantTable& table,
                                const std::vector<std::filesystem::path>& files,
                                const std::filesystem::path& folder,
                                PlantFiles& plant_files);

}  // namespace fdi::trainer
