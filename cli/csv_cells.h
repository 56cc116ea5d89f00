#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fdi::cli {

/// Splits CSV into cells after RFC 4180, one line of the file at a time, so
/// that it can come from a pipe:
///
///     record = cell *(separator cell) break      break = LF / CRLF
///     cell   = *blank (text / DQUOTE *(char / 2DQUOTE) DQUOTE) *blank
///
/// A quoted cell may hold separators, line breaks and doubled quotes. Beyond
/// the RFC, the separator need not be a comma, blanks around a cell do not
/// count, and a byte order mark is skipped.
class CsvCells {
 public:
  explicit CsvCells(char separator = ',') : separator_(separator) {}

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

  char separator_;
  State state_{State::kBefore};
  bool first_line_{true};
  std::vector<std::string> cells_;
  std::string cell_;
};

/// A finite number and nothing else; it may begin with "+".
std::optional<double> ParseNumber(std::string_view text, char decimal = '.');

/// The shortest text that reads back as the same double.
std::string NumberText(double value);

/// For messages: "text", cut to 60 characters.
std::string Quoted(std::string_view text);

/// "a,b"
std::string Listed(const std::vector<std::string>& names);

/// What a cell says about the sign of decimals.
enum class Digits {
  kNone,       ///< No sign, or no number.
  kDecimal,    ///< "0.5", "12.34": the sign cannot group thousands.
  kEither,     ///< "1.234"
  kThousands,  ///< "1.234.567", "1.234,5"
};
/// @param sign the first one in the cell, unless kNone.
Digits DigitsOf(std::string_view cell, char& sign);

/// The separator of a table: the one that cuts `header` and `row` into the same
/// number of cells, as many as possible.
char FindSeparator(std::string_view header, std::string_view row);

/// The whole of a file, `-` for stdin, as UTF-8 with LF: gzip is unpacked,
/// UTF-16 (with a byte order mark, or told by its zeros) is converted, and what
/// is neither UTF-8 nor UTF-16 is taken as Latin-1.
/// @throws NotFoundError if there is no such file; DataError naming it and what
///   it is instead (folder, spreadsheet, Parquet, damaged gzip, binary).
std::string ReadTextFile(const std::filesystem::path& path);
/// The same of bytes that were read, except for gzip.
std::string ToUtf8(std::string bytes, const std::string& source);

/// Whether two names of columns are equal; case does not count.
bool SameName(std::string_view a, std::string_view b);

/// Writes a record. A text that a spreadsheet would run as a formula (it begins
/// with = + - @ and is no number) gets a ' in front, which CsvCells takes away
/// again. A cell is quoted where it must be; the line ends with LF,
/// as those of all other text files on the system do.
void WriteCsvLine(std::ostream& out, const std::vector<std::string>& cells);

}  // namespace fdi::cli
