#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "import/csv.h"

namespace fdi::importer {

/// A file with the tags of many loops, read once. Each loop is then read as a
/// small table of its columns by ReadCsv(). Thread safe once constructed.
class ColumnIndex {
 public:
  /// @param map the form of the file, as far as the user states it.
  /// @param max_lines 0: all; otherwise only the first lines are kept.
  /// @throws NotFoundError, DataError as TextLines::OfFile() and FindLayout(),
  ///   and if a gzip takes more than 240 MiB of memory.
  ColumnIndex(const std::filesystem::path& path, const ColumnMap& map,
              std::size_t max_lines = 0);

  /// For CsvOptions of what Project() returns.
  const LinePlaces& source() const { return source_; }
  /// Columns of values, or tags of a long table.
  const std::vector<std::string>& tags() const { return tags_; }
  /// The form of the table, for reading what Project() returns.
  const ColumnMap& form() const { return form_; }
  std::size_t bytes() const;

  /// The table with its times and only these tags, rows in the same lines.
  std::string Project(const std::vector<std::string>& tags) const;

 private:
  struct Row {
    std::size_t begin;
    std::size_t length;
    std::size_t first_cell;  // In cells_, unless the table is long.
    std::size_t count;       // Number of cells.
    std::size_t line;        // From 1.
  };
  void FindForm(const ColumnMap& map);
  void IndexRows();
  /// @param line of its first line; set behind its last. @returns its end.
  std::size_t TakeRecord(std::size_t begin, std::size_t& line);
  /// The last line of the header.
  std::size_t HeaderEnd() const {
    return static_cast<std::size_t>(form_.skip + form_.header_rows);
  }
  std::string_view CellAt(const Row& row, std::size_t cell) const;
  std::size_t ColumnOf(std::string_view name) const;
  std::string ProjectLong(const std::vector<std::string>& tags) const;

  LinePlaces source_;
  bool packed_{false};
  std::string text_;
  ColumnMap form_;
  std::vector<std::string> names_;
  std::vector<std::string> tags_;
  std::vector<Row> rows_;
  std::vector<std::uint32_t> cells_;  // Begin of each cell in its row.
  std::unordered_map<std::string, std::vector<std::size_t>> rows_of_tag_;
};

}  // namespace fdi::importer
