#include "bench/study/csv_rows.h"

#include <sstream>

#include "base/csv_cells.h"
#include "base/error.h"

namespace fdi::trainer::study {

CsvRows::CsvRows(const std::filesystem::path& path,
                 const std::vector<std::string>& required,
                 const std::vector<std::string>& optional)
    : source_(path.string()), columns_(required) {
  columns_.insert(columns_.end(), optional.begin(), optional.end());
  std::istringstream input(ReadTextFile(path));
  CsvCells record;
  const std::vector<std::string>& cells = record.cells();
  // Messages name the line on which a record ends; a quoted cell may span some.
  std::int64_t number = 0;
  for (std::string line; std::getline(input, line);) {
    ++number;
    if (!record.TakeLine(line) || record.blank()) {
      continue;
    }
    if (width_ == 0) {
      TakeHeader(cells, required.size(), number);
      continue;
    }
    if (cells.size() != width_) {
      RefuseLine(number, std::to_string(cells.size()) +
                             " cells, the header has " +
                             std::to_string(width_));
    }
    // Cells are stored in the order in which the caller named the columns.
    std::vector<std::string>& row = rows_.emplace_back();
    for (const std::ptrdiff_t position : positions_) {
      row.emplace_back(position < 0
                           ? std::string()
                           : cells[static_cast<std::size_t>(position)]);
    }
    lines_.push_back(number);
  }
  if (rows_.empty()) {
    throw DataError(source_ + ": has no rows");
  }
}

void CsvRows::TakeHeader(const std::vector<std::string>& cells,
                         std::size_t required, std::int64_t line) {
  width_ = cells.size();
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::ptrdiff_t found = -1;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (!SameName(cells[i], columns_[c])) {
        continue;
      }
      if (found >= 0) {
        RefuseLine(line, "column " + columns_[c] + " is there twice");
      }
      found = static_cast<std::ptrdiff_t>(i);
    }
    if (found < 0 && c < required) {
      RefuseLine(line, "column " + columns_[c] + " is missing");
    }
    positions_.push_back(found);
  }
}

const std::string& CsvRows::Cell(std::size_t row, std::size_t column) const {
  return rows_[row][column];
}

double CsvRows::Number(std::size_t row, std::size_t column) const {
  const std::string& cell = Cell(row, column);
  const auto value = ParseNumber(cell);
  if (!value) {
    Refuse(row, columns_[column] + " '" + cell + "' is not a finite number");
  }
  return *value;
}

void CsvRows::Refuse(std::size_t row, const std::string& reason) const {
  RefuseLine(lines_[row], reason);
}

void CsvRows::RefuseLine(std::int64_t line, const std::string& reason) const {
  throw DataError(source_ + ":" + std::to_string(line) + ": " + reason);
}

}  // namespace fdi::trainer::study
