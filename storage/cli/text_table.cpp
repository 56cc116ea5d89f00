#include "storage/cli/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

// Code points of UTF-8 text, each taken as one cell of the terminal.
std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (c & '\xC0') != '\x80'; }));
}

void Pad(std::ostream& out, std::size_t count) {
  out << std::string(count, ' ');
}

}  // namespace

TextTable::TextTable(std::vector<Column> columns)
    : columns_(std::move(columns)) {}

void TextTable::AddRow(std::vector<std::string> cells) {
  Require(cells.size() == columns_.size(), "TextTable: one cell per column");
  rows_.push_back(std::move(cells));
}

void TextTable::Print(std::ostream& out) const {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t width = Width(columns_[c].heading);
    for (const auto& row : rows_) {
      width = std::max(width, Width(row[c]));
    }
    widths.push_back(width);
  }
  const auto print = [&](const auto& cell_of) {
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const std::string& cell = cell_of(c);
      const std::size_t padding = widths[c] - Width(cell);
      if (columns_[c].align == Align::kRight) {
        Pad(out, padding);
        out << cell;
      } else {
        out << cell;
        Pad(out, c + 1 < columns_.size() ? padding : 0);
      }
      out << (c + 1 < columns_.size() ? "  " : "\n");
    }
  };
  print(
      [&](std::size_t c) -> const std::string& { return columns_[c].heading; });
  for (const auto& row : rows_) {
    print([&](std::size_t c) -> const std::string& { return row[c]; });
  }
}

std::string FormatNumber(double value, int decimals) {
  if (!std::isfinite(value)) {
    return "-";
  }
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace fdi::cli
