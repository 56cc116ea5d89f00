#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/text_lines.h"
#include "import/csv.h"

namespace fdi::importer {

/// The form of a table.
struct Layout {
  ColumnMap map;  ///< With what it left open; signals are those of the caller.
  std::vector<std::string> names;  ///< As CsvReader::names().
  /// Units and descriptions of each column from further rows of the header.
  std::vector<std::string> about;
  /// Choices that the table leaves open, by key of the map ("decimal", "date",
  /// "good"): what was chosen, and why.
  std::map<std::string, std::string> choices;
};

/// Finds what `map` does not set: separator, rows of the header, time column
/// and its order, decimal sign, thousands, order of dates, columns of tags,
/// values and quality. All rows are evidence; what a few rows of a long table
/// say decides nothing.
/// @param choose what the evidence leaves open is chosen and named in
///   Layout::choices; otherwise it is left open, or refused.
/// @throws DataError if there is no header, or if the decimal sign is
///   ambiguous; if there are more than 20 000 columns.
Layout FindLayout(const TextLines& lines, ColumnMap map, bool choose);

/// Names that occur more than once get numbers: "Value (1)", "Value (2)".
void NumberRepeated(std::vector<std::string>& names);

/// The name of column `index` if its cell in the header is empty: "column 3".
std::string UnnamedAs(const std::string& cell, std::size_t index);

}  // namespace fdi::importer
