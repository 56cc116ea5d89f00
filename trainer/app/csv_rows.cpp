#include "trainer/app/csv_rows.h"

#include <charconv>
#include <cmath>
#include <fstream>

#include "diagnosis/error.h"
#include "storage/csv_cells.h"
#include "storage/csv_columns.h"

namespace fdi::trainer {

CsvRows::CsvRows(const std::filesystem::path& path,
                 const std::vector<std::string>& required,
                 const std::vector<std::string>& optional)
    : source_(path.string()), columns_(required) {
  columns_.insert(columns_.end(), optional.begin(), optional.end());
  if (!std::filesystem::exists(path)) {
    throw NotFoundError("no file " + source_);
  }
  std::ifstream input(path);
  if (!input || std::filesystem::is_directory(path)) {
    throw DataError(source_ + ": cannot be read");
  }
  std::vector<std::string_view> cells;
  std::int64_t number = 0;
  for (std::string line; std::getline(input, line);) {
    ++number;
    if (storage::TrimCell(line).empty()) {
      continue;
    }
    storage::SplitCells(line, cells);
    if (width_ == 0) {
      TakeHeader(cells, required.size());
      continue;
    }
    if (cells.size() != width_) {
      RefuseLine(number, std::to_string(cells.size()) +
                             " cells, the header has " +
                             std::to_string(width_));
    }
    std::vector<std::string>& row = rows_.emplace_back();
    for (const std::ptrdiff_t position : positions_) {
      row.emplace_back(position < 0
                           ? std::string_view()
                           : cells[static_cast<std::size_t>(position)]);
    }
    lines_.push_back(number);
  }
  if (rows_.empty()) {
    throw DataError(source_ + ": has no rows");
  }
}

void CsvRows::TakeHeader(const std::vector<std::string_view>& cells,
                         std::size_t required) {
  width_ = cells.size();
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::ptrdiff_t found = -1;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (!storage::SameName(cells[i], columns_[c])) {
        continue;
      }
      if (found >= 0) {
        RefuseLine(1, "column " + columns_[c] + " is there twice");
      }
      found = static_cast<std::ptrdiff_t>(i);
    }
    if (found < 0 && c < required) {
      RefuseLine(1, "column " + columns_[c] + " is missing");
    }
    positions_.push_back(found);
  }
}

const std::string& CsvRows::Cell(std::size_t row, std::size_t column) const {
  return rows_[row][column];
}

double CsvRows::Number(std::size_t row, std::size_t column) const {
  const std::string& cell = Cell(row, column);
  double value = 0.0;
  const auto [end, error] =
      std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc() || end != cell.data() + cell.size() ||
      !std::isfinite(value)) {
    Refuse(row, columns_[column] + " '" + cell + "' is not a finite number");
  }
  return value;
}

void CsvRows::Refuse(std::size_t row, const std::string& reason) const {
  RefuseLine(lines_[row], reason);
}

void CsvRows::RefuseLine(std::int64_t line, const std::string& reason) const {
  throw DataError(source_ + ":" + std::to_string(line) + ": " + reason);
}

}  // namespace fdi::trainer
