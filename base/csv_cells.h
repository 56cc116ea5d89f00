#pragma once

#include <array>
#include <charconv>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace fdi {

/// Splits CSV into cells as in RFC 4180, one line at a time, so that the input
/// can be a pipe:
///
///     record = cell *(separator cell) break      break = LF / CRLF
///     cell   = *blank (text / DQUOTE *(char / 2DQUOTE) DQUOTE) *blank
///
/// A quoted cell may contain separators, line breaks and doubled quotes. In
/// addition to the RFC, the separator may be another character, blanks around a
/// cell are ignored, and a byte order mark is skipped.
class CsvCells {
 public:
  explicit CsvCells(char separator = ',') : separator_(separator) {}

  /// Processes the next line, without its LF. @returns whether it ends a
  /// record; if not, a quote is open and the record continues on the next line.
  bool TakeLine(std::string_view line);
  /// A quote is still open, which is an error at the end of a file.
  bool open() const { return state_ == State::kQuoted; }

  /// Cells of the last complete record.
  const std::vector<std::string>& cells() const { return cells_; }
  /// Drops empty cells behind the first `count`.
  void Trim(std::size_t count) {
    while (cells_.size() > count && cells_.back().empty()) {
      cells_.pop_back();
    }
  }
  /// True if that record is a blank line.
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

/// Parses a finite number and nothing else; a leading "+" is allowed.
std::optional<double> ParseNumber(std::string_view text, char decimal = '.');

/// The shortest text that round-trips to the same number.
template <typename Number>
std::string NumberText(Number value) {
  std::array<char, 32> digits;  // A double takes 24 at most.
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return {digits.data(), end};
}

/// For messages: the text in quotes, truncated to 60 characters.
std::string Quoted(std::string_view text);

/// "a,b"
std::string Listed(const std::vector<std::string>& names);

/// The evidence of a cell for the decimal sign.
enum class Digits {
  kNone,       ///< No sign, or no number.
  kDecimal,    ///< "0.5", "12.34": the sign cannot group thousands.
  kEither,     ///< "1.234"
  kThousands,  ///< "1.234.567", "1.234,5"
};
/// @param sign set to the first one in the cell, unless kNone.
Digits DigitsOf(std::string_view cell, char& sign);

/// Detects the separator of a table: the one that splits most of `lines` into
/// the same number of cells, as many as possible.
char FindSeparator(std::span<const std::string_view> lines);

/// `cell` without the signs that group its digits by threes: blanks, ' and
/// `thousands` (NUL: nothing else). @returns nothing if there is no such group.
std::optional<std::string> Ungrouped(std::string_view cell, char thousands);

/// `text` in lower case without accents, for comparing words: "Stellgröße" is
/// "stellgrosse", "Przepływ" is "przeplyw".
std::string PlainText(std::string_view text);

/// Reads a whole file, or stdin for `-`, as UTF-8 with LF: gzip is
/// decompressed, UTF-16 (with a byte order mark, or recognised by its zeros) is
/// converted, and anything that is neither UTF-8 nor UTF-16 is read as Latin-1.
/// A gzip may unpack to a hundred times its size (4 MiB are always accepted)
/// and to 32 MiB; for tables see TextLines.
/// @throws NotFoundError if there is no such file; DataError naming it and its
///   actual type (folder, spreadsheet, Parquet, damaged gzip, binary) or limit.
std::string ReadTextFile(const std::filesystem::path& path);
/// The same for bytes in memory, except for gzip.
std::string ToUtf8(std::string bytes, const std::string& source);

/// True if two column names are equal, ignoring case.
bool SameName(std::string_view a, std::string_view b);

/// Writes a record. Text that a spreadsheet would evaluate as a formula (it
/// begins with = + - @ and is not a number) gets a leading ', which CsvCells
/// removes. Cells are quoted only where necessary; the line ends with LF.
void WriteCsvLine(std::ostream& out, const std::vector<std::string>& cells);

}  // namespace fdi
