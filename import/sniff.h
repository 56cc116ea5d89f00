#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "import/csv.h"
#include "import/signal_guess.h"

namespace fdi::importer {

/// Contents of a file, and a map of it.
struct Sniffed {
  ColumnMap map;  ///< Without signals: those are in `columns`.
  std::vector<SniffedColumn> columns;
  std::size_t rows{0};
  std::vector<double> times_s{};  ///< By row, from ScanColumns().
  bool dated{false};
  TimeUnit time;
  std::string resample;  ///< Proposed; empty: not needed.
  double period_s{0.0};
  double jitter_s{0.0};
  std::size_t gaps{0};
  double longest_gap_s{0.0};
  bool compressed{false};
  /// Choices that the table leaves open, with their reasons.
  std::vector<std::string> choices;
  /// The importer's report on the table with this map: its notes, or why it
  /// refuses it; and what the record cannot show.
  std::vector<std::string> findings;
};

/// Reads the form of a table and all of its columns, or the first 4 million
/// cells of them, without any signal. @throws as Sniff().
Sniffed ScanColumns(const TextLines& lines, ColumnMap map);

/// Analyses a table with the reader of the importer. The settings of `map` are
/// kept, including its signals; others are guessed from units, ranges, words
/// and ISA 5.1 letters, in this order of weight, and from the first 4 million
/// cells.
/// @throws DataError if there is no header, no column of times or no row.
Sniffed Sniff(const TextLines& lines, ColumnMap map);
Sniffed Sniff(std::string_view text, const std::string& source, ColumnMap map);

/// The map as TOML to edit, with guesses and choices marked.
std::string MapText(const Sniffed& found, const std::string& file);

}  // namespace fdi::importer
