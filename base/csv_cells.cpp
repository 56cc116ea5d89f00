#include "base/csv_cells.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <ostream>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace fdi {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// The CR of a CRLF counts as a blank.
bool IsBlank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

// True if a spreadsheet would evaluate the cell as a formula. Numbers are not
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
// rows. Among equal ones the first in the list is taken.
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
