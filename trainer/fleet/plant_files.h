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

/// The files of a plant, each read once for all loops as long as they fit into
/// the memory set aside for them. Thread safe.
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
  /// The tags of all files that TagsOf() was asked for, by file.
  std::map<std::string, std::vector<std::string>> AllTags() const;

 private:
  struct Shelved {
    mutable Mutex loading;
    std::shared_ptr<const importer::ColumnIndex> index GUARDED_BY(loading);
    std::unique_ptr<importer::TagNames> tags GUARDED_BY(loading);
    std::string error GUARDED_BY(loading);  // DataError's; empty: none.
    std::uint64_t used{0};
  };
  Shelved& At(const std::filesystem::path& path);
  void Load(const std::filesystem::path& path, Shelved& shelved)
      REQUIRES(shelved.loading);
  void MakeRoom();

  importer::ColumnMap form_;
  std::size_t max_lines_;
  mutable Mutex mutex_;
  std::map<std::filesystem::path, Shelved> files_ GUARDED_BY(mutex_);
  std::uint64_t clock_ GUARDED_BY(mutex_){0};
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
                                PlantFiles& shelf);

}  // namespace fdi::trainer
