#pragma once

#include <cstddef>
#include <ostream>
#include <string>
#include <vector>

#include "report/terminal.h"

namespace fdi::report {

enum class Align { kLeft, kRight };

/// Emphasis of a cell; the text always carries the same information.
enum class Tone {
  kPlain,
  kGood,     ///< Green.
  kAlarm,    ///< Bold red: needs attention.
  kWarning,  ///< Yellow.
  kQuiet,    ///< Dim.
};

/// "\x1b[31m", ...; empty for kPlain.
const char* ToneCode(Tone tone);

/// Columns aligned for a terminal: a heading with units, then the rows.
class TextTable {
 public:
  struct Column {
    std::string heading;  ///< With its unit: "MSE [%^2]".
    Align align{Align::kLeft};
    /// If the table is too wide, columns above 0 are omitted, the highest
    /// first.
    int spare{0};
    /// If the table is too wide, cells may be cut to this width; 0: never.
    std::size_t least_width{0};
  };

  explicit TextTable(std::vector<Column> columns);
  /// @throws std::invalid_argument unless there is one cell per column.
  void AddRow(std::vector<std::string> cells);
  /// Applies to the last row. @throws std::invalid_argument if there is none.
  void SetTone(std::size_t column, Tone tone);

  /// Plain, or styled: in colour and no wider than the style allows, with a
  /// last line that names the omitted columns.
  void Print(std::ostream& out, const TextStyle& style = {}) const;
  /// As printed plainly, without the last line break.
  std::string Text() const;
  bool empty() const { return rows_.empty(); }

 private:
  struct Row {
    std::vector<std::string> cells;
    std::vector<Tone> tones;
  };
  std::vector<std::size_t> Widths() const;
  std::vector<std::size_t> Least(std::vector<std::size_t> widths) const;
  std::vector<std::size_t> Shown(const std::vector<std::size_t>& widths,
                                 std::size_t width) const;

  std::vector<Column> columns_;
  std::vector<Row> rows_;
};

/// Code points of UTF-8 text, each taken as one cell of the terminal.
std::size_t TextWidth(const std::string& text);

/// `text` if it fits, or its beginning and an ellipsis. @param width > 0
std::string Shortened(const std::string& text, std::size_t width);

/// `value` with `decimals`; "-" if it is not finite.
std::string FormatNumber(double value, int decimals);

}  // namespace fdi::report
