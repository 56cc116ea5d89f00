#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "import/csv.h"

namespace fdi::importer {

/// A column, or a tag of a long table, and what it seems to be.
struct SniffedColumn {
  std::string name;
  std::string about;  ///< Units and descriptions below the name.
  std::vector<double> times_s{};
  std::vector<double> values{};
  std::size_t cells{0};
  std::size_t missing{0};
  std::vector<std::string> words{};      ///< Neither numbers nor known words.
  std::optional<ColumnMapping> given{};  ///< By the caller's map.
  std::optional<Signal> signal{};
  std::string unit{};
  std::vector<double> raw{};   ///< Cells that are `span`; empty: as they are.
  std::vector<double> span{};  ///< In `unit`.
  bool opening{false};
  std::string guessed{};  ///< Reasons, and what is uncertain.

  /// Quantile of the values, which are not empty; `share` in [0, 1].
  double Quantile(double share) const;
};

/// What a file holds, and a map of it.
struct Sniffed {
  ColumnMap map;  ///< Without signals: those are in `columns`.
  std::vector<SniffedColumn> columns;
  std::size_t rows{0};
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
  /// What the importer says about the table with this map: its notes, or why it
  /// refuses it; what the record cannot show.
  std::vector<std::string> findings;
};

/// Analyses a table with the reader of the importer. What `map` sets is taken
/// over, its signals, too; other signals are guessed from units, ranges, words
/// and ISA 5.1 letters, in this order of weight, and from the first 4 million
/// cells.
/// @throws DataError if there is no header, no column of times or no row.
Sniffed Sniff(const TextLines& lines, const std::string& source, ColumnMap map);
Sniffed Sniff(std::string_view text, const std::string& source, ColumnMap map);

/// The map as TOML to edit, with guesses and choices marked.
std::string MapText(const Sniffed& found, const std::string& file);

}  // namespace fdi::importer
