#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fdi::cli {

/// Splits CSV into cells after RFC 4180, one line of the file at a time, so
/// that it can come from a pipe:
///
///     record = cell *("," cell) break      break = LF / CRLF
///     cell   = *blank (text / DQUOTE *(char / 2DQUOTE) DQUOTE) *blank
///
/// A quoted cell may hold commas, line breaks and doubled quotes. Beyond the
/// RFC, blanks around a cell do not count, and a byte order mark is skipped.
class CsvCells {
 public:
  /// Takes the next line, without its LF. @returns whether it ends a record;
  /// if not, a quote is open and the record goes on in the next line.
  bool TakeLine(std::string_view line);
  /// A quote is still open: at the end of a file, an error.
  bool open() const { return state_ == State::kQuoted; }

  /// Of the record that ended last.
  const std::vector<std::string>& cells() const { return cells_; }
  /// Whether that record is a blank line.
  bool blank() const { return cells_.size() == 1 && cells_.front().empty(); }

 private:
  enum class State {
    kBefore,  // The cell has not begun.
    kText,    // In a cell without quotes.
    kQuoted,  // Within quotes.
    kAfter,   // Behind the closing quote, or at one that is doubled.
  };
  void Take(char c);
  void EndCell();

  State state_{State::kBefore};
  bool first_line_{true};
  std::vector<std::string> cells_;
  std::string cell_;
};

/// A finite number and nothing else; it may begin with "+".
std::optional<double> ParseNumber(std::string_view text);

/// Whether two names of columns are equal; case does not count.
bool SameName(std::string_view a, std::string_view b);

/// Writes a record. A cell is quoted where it must be; the line ends with LF,
/// as those of all other text files on the system do.
void WriteCsvLine(std::ostream& out, const std::vector<std::string>& cells);

}  // namespace fdi::cli
