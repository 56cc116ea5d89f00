#include "cli/csv_cells.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <ostream>

namespace fdi::cli {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// The CR of a CRLF is a blank too.
bool IsBlank(char c) {
  return c == ' ' || c == '\t' || c == '\r';
}

}  // namespace

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
        cell_ += c;  // It was the first one of two: a quote of the text.
        state_ = State::kQuoted;
      } else if (c == ',') {
        EndCell();
      } else if (!IsBlank(c)) {
        cell_ += c;  // "FV"-101, which no writer should write.
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
      if (c == ',') {
        EndCell();
      } else {
        cell_ += c;
      }
      return;
  }
}

void CsvCells::EndCell() {
  while (state_ == State::kText && !cell_.empty() && IsBlank(cell_.back())) {
    cell_.pop_back();
  }
  cells_.push_back(cell_);
  cell_.clear();
  state_ = State::kBefore;
}

std::optional<double> ParseNumber(std::string_view text) {
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

bool SameName(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

void WriteCsvLine(std::ostream& out, const std::vector<std::string>& cells) {
  const char* separator = "";
  for (const std::string& cell : cells) {
    out << separator;
    separator = ",";
    // Blanks at the ends are quoted, since readers may drop them.
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

}  // namespace fdi::cli
