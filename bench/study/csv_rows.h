#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fdi::trainer::study {

/// A CSV file of named columns, in any order and case, further ones ignored.
/// Blank lines are skipped.
class CsvRows {
 public:
  /// @throws NotFoundError if there is no such file; DataError naming file,
  ///   line and reason: a required column that is missing, a column twice,
  ///   cells too few or too many, no rows.
  CsvRows(const std::filesystem::path& path,
          const std::vector<std::string>& required,
          const std::vector<std::string>& optional = {});

  std::size_t size() const { return rows_.size(); }

  /// The columns count in the order asked for, required ones first; the cell of
  /// an optional column that is not there is empty.
  const std::string& Cell(std::size_t row, std::size_t column) const;
  /// @throws DataError unless the cell is a finite number.
  double Number(std::size_t row, std::size_t column) const;
  /// @throws DataError naming file, line and `reason`.
  [[noreturn]] void Refuse(std::size_t row, const std::string& reason) const;

 private:
  void TakeHeader(const std::vector<std::string>& cells, std::size_t required,
                  std::int64_t line);
  [[noreturn]] void RefuseLine(std::int64_t line,
                               const std::string& reason) const;

  std::string source_;
  std::vector<std::string> columns_;
  std::vector<std::ptrdiff_t> positions_;  // In the file; −1 if not there.
  std::size_t width_{0};
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::int64_t> lines_;
};

}  // namespace fdi::trainer::study
