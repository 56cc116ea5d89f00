#pragma once

#include <cstddef>
#include <ostream>
#include <string>
#include <vector>

#include "cli/terminal.h"

namespace fdi::cli {

enum class Align { kLeft, kRight };

/// What a cell says beside its text, which always says it too.
enum class Tone {
  kPlain,
  kAlarm,    ///< Bold red: wants somebody.
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
    /// Where the table is too wide, columns above 0 are left out, the highest
    /// first.
    int spare{0};
  };

  explicit TextTable(std::vector<Column> columns);
  /// @throws std::invalid_argument unless there is one cell per column.
  void AddRow(std::vector<std::string> cells);
  /// Of a cell of the last row. @throws std::invalid_argument if there is none.
  void SetTone(std::size_t column, Tone tone);

  /// Plain, or for people: in colour, no wider than fits, with a last line that
  /// names the columns left out.
  void Print(std::ostream& out, const TextStyle& style = {}) const;
  bool empty() const { return rows_.empty(); }

 private:
  struct Row {
    std::vector<std::string> cells;
    std::vector<Tone> tones;
  };
  std::vector<std::size_t> Widths() const;
  std::vector<std::size_t> Shown(const std::vector<std::size_t>& widths,
                                 std::size_t width) const;

  std::vector<Column> columns_;
  std::vector<Row> rows_;
};

/// Code points of UTF-8 text, each taken as one cell of the terminal.
std::size_t TextWidth(const std::string& text);

/// `value` with `decimals`, "-" where it is not finite.
std::string FormatNumber(double value, int decimals);

}  // namespace fdi::cli
