#include "base/csv_cells.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <ostream>
#include <utility>

#include <unistd.h>
#include <zlib.h>

#include "base/error.h"
#include "base/text.h"

namespace fdi {
namespace {

constexpr std::size_t kUnpackedAlways = 4U << 20U;
constexpr std::size_t kUnpackedAtMost = 200U << 20U;
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// The CR of a CRLF counts as a blank.
bool IsBlank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

void AppendUtf8(char32_t code, std::string& out) {
  const auto tail = [&](int shift) {
    out += static_cast<char>(0x80U | ((code >> shift) & 0x3FU));
  };
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xC0U | (code >> 6U));
    tail(0);
  } else if (code < 0x10000) {
    out += static_cast<char>(0xE0U | (code >> 12U));
    tail(6);
    tail(0);
  } else {
    out += static_cast<char>(0xF0U | (code >> 18U));
    tail(12);
    tail(6);
    tail(0);
  }
}

// A code point above U+FFFF less 0x10000 has twenty bits: a pair of units,
// 0xD800 plus the upper and 0xDC00 plus the lower ten. A byte order mark is
// dropped.
std::string FromUtf16(std::string_view bytes, bool big_endian) {
  const auto unit = [&](std::size_t i) {
    const auto byte = [&](std::size_t at) {
      return static_cast<unsigned char>(bytes[at]);
    };
    return static_cast<char32_t>(big_endian ? byte(i) << 8U | byte(i + 1)
                                            : byte(i + 1) << 8U | byte(i));
  };
  std::string text;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    char32_t code = unit(i);
    if (code >= 0xD800 && code < 0xDC00 && i + 3 < bytes.size()) {
      i += 2;
      code = 0x10000 + ((code - 0xD800) << 10U) + (unit(i) - 0xDC00);
    }
    if (i > 0 || code != 0xFEFF) {
      AppendUtf8(code, text);
    }
  }
  return text;
}

// Checks the number of continuation bytes (10xxxxxx) after each first byte, not
// whether the code point is valid. That is enough: in Latin-1 a letter with an
// accent is rarely followed by just such bytes.
bool IsUtf8(std::string_view text) {
  std::size_t more = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool tail = (byte & 0xC0U) == 0x80U;
    if (tail != (more > 0)) {
      return false;
    }
    more = tail          ? more - 1
           : byte < 0x80 ? 0
           : byte < 0xE0 ? 1
           : byte < 0xF0 ? 2
                         : 3;
  }
  return more == 0;
}

// Whether a spreadsheet would evaluate the cell as a formula. Numbers are not
// formulas, not even hexadecimal ones.
bool IsFormula(const std::string& cell) {
  if (cell.size() < 2 || std::string_view("=+-@\t\r").find(cell.front()) ==
                             std::string_view::npos) {
    return false;
  }
  char* end = nullptr;
  std::strtod(cell.c_str(), &end);
  return end != cell.c_str() + cell.size();
}

// Formulas are written with a leading quote, which spreadsheets hide. Text that
// already looks like a guarded formula gets one more, so that it round-trips.
bool IsGuarded(const std::string& cell) {
  const std::size_t quotes = cell.find_first_not_of('\'');
  return quotes != 0 && quotes != std::string::npos &&
         IsFormula(cell.substr(quotes));
}

}  // namespace

// The state is kept between lines only while a quote is open; the line break,
// which the caller has removed, belongs to the cell then.
bool CsvCells::TakeLine(std::string_view line) {
  if (first_line_ && line.starts_with(kByteOrderMark)) {
    line.remove_prefix(kByteOrderMark.size());
  }
  first_line_ = false;
  if (state_ == State::kQuoted) {
    cell_ += '\n';
  } else {
    cells_.clear();
  }
  for (const char c : line) {
    Take(c);
  }
  if (state_ == State::kQuoted) {
    return false;
  }
  EndCell();
  return true;
}

void CsvCells::Take(char c) {
  switch (state_) {
    case State::kQuoted:
      if (c == '"') {
        state_ = State::kAfter;
      } else {
        cell_ += c;
      }
      return;
    case State::kAfter:
      if (c == '"') {
        cell_ += c;  // The first of two: an escaped quote.
        state_ = State::kQuoted;
      } else if (c == separator_) {
        EndCell();
      } else if (!IsBlank(c)) {
        cell_ += c;  // "FV"-101 is invalid, but harmless.
      }
      return;
    case State::kBefore:
      if (c == '"') {
        state_ = State::kQuoted;
        return;
      }
      if (IsBlank(c)) {
        return;
      }
      state_ = State::kText;
      [[fallthrough]];
    case State::kText:
      if (c == separator_) {
        EndCell();
      } else {
        cell_ += c;
      }
      return;
  }
}

// Blanks are dropped behind a cell without quotes only: quoted ones are part of
// it.
void CsvCells::EndCell() {
  while (state_ == State::kText && !cell_.empty() && IsBlank(cell_.back())) {
    cell_.pop_back();
  }
  if (IsGuarded(cell_)) {
    cell_.erase(0, 1);
  }
  cells_.push_back(cell_);
  cell_.clear();
  state_ = State::kBefore;
}

// std::from_chars, unlike strtod(), does not depend on the locale, skips no
// blanks and gives the double nearest to the text. It accepts no leading +,
// which is therefore skipped, and accepts nan and inf, which are refused below.
std::optional<double> ParseNumber(std::string_view text, char decimal) {
  std::string point;
  if (decimal != '.') {
    // Beside a decimal comma a point can only group thousands: "1.234" would be
    // read as 1.234 instead of 1234.
    if (text.find('.') != std::string_view::npos) {
      return std::nullopt;
    }
    point = text;
    std::replace(point.begin(), point.end(), decimal, '.');
    text = point;
  }
  const char* first = text.data();
  const char* last = first + text.size();
  if (first != last && *first == '+') {
    ++first;
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(first, last, value);
  // A number too small for a double is out of range as well.
  if (error != std::errc() || end != last || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::string Quoted(std::string_view text) {
  return '"' + std::string(text.substr(0, 60)) + '"';
}

std::string Listed(const std::vector<std::string>& names) {
  return JoinText(names, ",");
}

//     grouped = 1*3DIGIT sign 3DIGIT       not beginning with 0
//
// "0.123" and "1.2345" have decimals, "1.234" may have either, and a second
// sign in a grouped number means thousands. With an exponent a number is not
// grouped.
Digits DigitsOf(std::string_view cell, char& sign) {
  if (!cell.empty() && (cell.front() == '+' || cell.front() == '-')) {
    cell.remove_prefix(1);
  }
  const std::size_t exponent = cell.find_first_of("eE");
  const std::string_view number = cell.substr(0, exponent);
  const std::size_t first = number.find_first_of(".,");
  if (first == std::string_view::npos ||
      number.find_first_not_of("0123456789.,") != std::string_view::npos) {
    return Digits::kNone;
  }
  sign = number[first];
  const std::size_t second = number.find_first_of(".,", first + 1);
  const bool grouped = first >= 1 && first <= 3 && number.front() != '0' &&
                       std::min(second, number.size()) - first == 4;
  if (second == std::string_view::npos) {
    return grouped && exponent == std::string_view::npos ? Digits::kEither
                                                         : Digits::kDecimal;
  }
  // Dates such as 01.02.2026 are not grouped in threes.
  return grouped ? Digits::kThousands : Digits::kNone;
}

// Separators are compared by (lines with the most usual number of cells, that
// number). The agreement comes first: a semicolon table with decimal commas may
// have more commas than semicolons, but not as many in the header as in the
// rows. Of equal ones the first in the list is taken.
char FindSeparator(std::span<const std::string_view> lines) {
  char best = ',';
  std::pair<std::size_t, std::size_t> most{0, 1};
  for (const char separator : {',', ';', '\t', '|'}) {
    std::map<std::size_t, std::size_t> counts;
    CsvCells cells(separator);
    for (const std::string_view line : lines) {
      if (cells.TakeLine(line) && cells.cells().size() > 1) {
        const std::size_t count = cells.cells().size();
        const std::pair fit{++counts[count], count};
        if (fit > most) {
          most = fit;
          best = separator;
        }
      }
    }
  }
  // Columns of fixed width, where nothing else cuts a line.
  const bool cut = most.first > 0;
  const bool blanks =
      !cut && std::ranges::any_of(lines, [](std::string_view line) {
        return line.find_first_not_of(' ') < line.find_last_of(' ');
      });
  return blanks ? ' ' : best;
}

std::optional<std::string> Ungrouped(std::string_view cell, char thousands) {
  constexpr std::string_view kNoBreak = "\xC2\xA0";
  constexpr std::string_view kNarrow = "\xE2\x80\xAF";
  const auto digit = [&](std::size_t i) {
    return i < cell.size() &&
           std::isdigit(static_cast<unsigned char>(cell[i])) != 0;
  };
  std::string plain;
  bool grouped = false;
  for (std::size_t i = 0; i < cell.size(); ++i) {
    const std::string_view rest = cell.substr(i);
    const std::size_t width = rest.starts_with(kNoBreak)  ? kNoBreak.size()
                              : rest.starts_with(kNarrow) ? kNarrow.size()
                                                          : 1;
    const bool group = width > 1 || cell[i] == ' ' || cell[i] == '\'' ||
                       (thousands != '\0' && cell[i] == thousands);
    if (!group) {
      plain += cell[i];
      continue;
    }
    const std::size_t next = i + width;
    if (i == 0 || !digit(i - 1) || !digit(next) || !digit(next + 1) ||
        !digit(next + 2) || digit(next + 3)) {
      return std::nullopt;
    }
    grouped = true;
    i += width - 1;
  }
  return grouped ? std::optional(plain) : std::nullopt;
}

std::string PlainText(std::string_view text) {
  // Letters of two bytes and what stands for each, in upper and lower case.
  static constexpr std::pair<std::string_view, std::string_view> kLetters[] = {
      {"ä", "a"}, {"ö", "o"}, {"ü", "u"}, {"ß", "ss"}, {"é", "e"}, {"è", "e"},
      {"ê", "e"}, {"à", "a"}, {"â", "a"}, {"ç", "c"},  {"ô", "o"}, {"î", "i"},
      {"á", "a"}, {"í", "i"}, {"ó", "o"}, {"ú", "u"},  {"ñ", "n"}, {"ą", "a"},
      {"ć", "c"}, {"ę", "e"}, {"ł", "l"}, {"ń", "n"},  {"ś", "s"}, {"ź", "z"},
      {"ż", "z"}, {"û", "u"}, {"ù", "u"}, {"ò", "o"},  {"ì", "i"}, {"ë", "e"},
      {"Ä", "a"}, {"Ö", "o"}, {"Ü", "u"}, {"É", "e"},  {"È", "e"}, {"À", "a"},
      {"Ç", "c"}, {"Ó", "o"}, {"Ł", "l"}, {"Ś", "s"},  {"Ż", "z"}, {"Ź", "z"},
      {"Ć", "c"}, {"Ę", "e"}, {"Ą", "a"}, {"Á", "a"},  {"Í", "i"}};
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    constexpr unsigned char kAsciiEnd = 0x80;
    // Most text is ASCII, and there is a lot of it.
    const auto letter =
        c < kAsciiEnd
            ? std::end(kLetters)
            : std::ranges::find(kLetters, text.substr(i, 2),
                                [](const auto& e) { return e.first; });
    if (letter != std::end(kLetters)) {
      plain += letter->second;
      ++i;
    } else {
      plain += static_cast<char>(std::tolower(c));
    }
  }
  return plain;
}

// The order of the tests matters. A file in UTF-16 of ASCII text is also valid
// UTF-8 with zeros in it, so UTF-16 is tested first. Latin-1 comes last,
// because every sequence of bytes is valid in it.
std::string ToUtf8(std::string bytes, const std::string& source) {
  const auto zero_at = [&](std::size_t i) {
    return bytes.size() > i && bytes[i] == '\0';
  };
  if (zero_at(0) && zero_at(1)) {
    throw DataError(source + ": is binary, not text: export it as CSV");
  }
  std::string text;
  if (bytes.starts_with("\xFF\xFE") || zero_at(1)) {
    text = FromUtf16(bytes, false);
  } else if (bytes.starts_with("\xFE\xFF") || zero_at(0)) {
    text = FromUtf16(bytes, true);
  } else if (IsUtf8(bytes)) {
    text = std::move(bytes);
    text.erase(0, text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0);
  } else {
    for (const char c : bytes) {
      AppendUtf8(static_cast<unsigned char>(c), text);
    }
  }
  if (text.starts_with("PK\x03\x04")) {
    throw DataError(source +
                    ": is a spreadsheet or zip archive, not text: save it as "
                    "CSV (or unpack it)");
  }
  if (text.starts_with("PAR1")) {
    throw DataError(source +
                    ": is a Parquet file: docs/import.md has the line of "
                    "DuckDB that makes it a CSV");
  }
  if (text.find('\0') != std::string::npos) {
    throw DataError(source + ": is binary, not text: export it as CSV");
  }
  // Without any LF, CR is taken as the line break (old Macintosh files).
  if (text.find('\n') == std::string::npos) {
    std::replace(text.begin(), text.end(), '\r', '\n');
  }
  return text;
}

std::string ReadTextFile(const std::filesystem::path& path) {
  const bool is_stdin = path == "-";
  const std::string source = is_stdin ? "stdin" : path.string();
  std::error_code error;
  if (!is_stdin && !std::filesystem::exists(path, error)) {
    throw NotFoundError("no file " + source);
  }
  if (!is_stdin && std::filesystem::is_directory(path, error)) {
    throw DataError(source + ": is a directory, not a file");
  }
  // zlib passes uncompressed files through.
  const auto close = [](gzFile file) { gzclose(file); };
  const std::unique_ptr<gzFile_s, decltype(close)> file(
      // gzclose() closes the descriptor. stdin itself has to stay open, hence
      // dup().
      is_stdin ? gzdopen(dup(STDIN_FILENO), "rb") : gzopen(path.c_str(), "rb"),
      close);
  if (!file) {
    throw DataError(source + ": cannot be opened: " + std::strerror(errno));
  }
  std::string bytes;
  std::array<char, 65536> part;
  int count = 0;
  while ((count = gzread(file.get(), part.data(), part.size())) > 0) {
    bytes.append(part.data(), static_cast<std::size_t>(count));
    // Ordinary tables shrink to a fifth or a twentieth; a few kilobytes that
    // unpack to gigabytes are an accident or an attack.
    const bool is_packed = gzdirect(file.get()) == 0;
    const z_off_t packed = gzoffset(file.get());  // -1 for a pipe.
    const std::size_t limit =
        packed < 0 ? kUnpackedAtMost
                   : std::clamp(100 * static_cast<std::size_t>(packed),
                                kUnpackedAlways, kUnpackedAtMost);
    if (is_packed && bytes.size() > limit) {
      throw DataError(
          source + ": unpacks to more than " +
          (limit == kUnpackedAtMost ? "200 MiB" : "100 times its size") +
          "; if it is right, unpack it with gunzip first");
    }
    if (is_packed && bytes.size() > kUnpackedAtMost / 8) {
      // In one step: doubling would need three times the memory at the end.
      bytes.reserve(kUnpackedAtMost + 2 * part.size());
    }
  }
  // gzread() returns 0 at the end of a truncated file, too; only gzerror() then
  // says Z_BUF_ERROR.
  int code = Z_OK;
  const char* reason = gzerror(file.get(), &code);
  if (count < 0 || code != Z_OK) {
    throw DataError(source + ": cannot be read: " +
                    (code == Z_ERRNO ? std::strerror(errno) : reason) +
                    (code == Z_ERRNO ? "" : "; try gzip -t, or export again"));
  }
  return ToUtf8(std::move(bytes), source);
}

bool SameName(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

// The guard is added before the cell is quoted: it is part of the content, and
// reading removes the quotes first.
void WriteCsvLine(std::ostream& out, const std::vector<std::string>& cells) {
  const char* separator = "";
  for (const std::string& text : cells) {
    const std::string cell =
        IsFormula(text) || IsGuarded(text) ? "'" + text : text;
    out << separator;
    separator = ",";
    // Blanks at either end are quoted, because readers may drop them.
    const bool quoted =
        cell.find_first_of(",\"\r\n") != std::string::npos ||
        (!cell.empty() && (IsBlank(cell.front()) || IsBlank(cell.back())));
    if (!quoted) {
      out << cell;
      continue;
    }
    out << '"';
    for (const char c : cell) {
      out << (c == '"' ? "\"\"" : std::string_view(&c, 1));
    }
    out << '"';
  }
  out << '\n';
}

}  // namespace fdi
