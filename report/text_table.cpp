#include "report/text_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <sstream>
#include <utility>

#include "base/error.h"

namespace fdi::report {
namespace {

constexpr const char* kBold = "\x1b[1m";
constexpr const char* kPlainAgain = "\x1b[0m";
constexpr std::size_t kGap = 2;  // Blanks between columns.

// The standard library pads by bytes, which is too few after "µ".
std::string Padded(const std::string& text, std::size_t width, Align align) {
  const std::string blanks(width - std::min(width, TextWidth(text)), ' ');
  return align == Align::kRight ? blanks + text : text + blanks;
}

std::string Toned(const std::string& text, const char* code, bool colour) {
  return colour && code[0] != '\0' ? code + text + kPlainAgain : text;
}

}  // namespace

const char* ToneCode(Tone tone) {
  switch (tone) {
    case Tone::kPlain:
      return "";
    case Tone::kGood:
      return "\x1b[32m";
    case Tone::kAlarm:
      return "\x1b[1;31m";
    case Tone::kWarning:
      return "\x1b[33m";
    case Tone::kQuiet:
      return "\x1b[2m";
  }
  return "";
}

TextTable::TextTable(std::vector<Column> columns)
    : columns_(std::move(columns)) {}

void TextTable::AddRow(std::vector<std::string> cells) {
  Require(cells.size() == columns_.size(), "TextTable: one cell per column");
  rows_.push_back(
      {std::move(cells), std::vector<Tone>(columns_.size(), Tone::kPlain)});
}

void TextTable::SetTone(std::size_t column, Tone tone) {
  Require(!rows_.empty() && column < columns_.size(),
          "TextTable: no such cell");
  rows_.back().tones[column] = tone;
}

std::vector<std::size_t> TextTable::Widths() const {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t width = TextWidth(columns_[c].heading);
    for (const Row& row : rows_) {
      width = std::max(width, TextWidth(row.cells[c]));
    }
    widths.push_back(width);
  }
  return widths;
}

// The widths, but the least ones for columns whose cells may be cut.
std::vector<std::size_t> TextTable::Least(
    std::vector<std::size_t> widths) const {
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (columns_[c].least_width > 0) {
      widths[c] = std::min(widths[c], columns_[c].least_width);
    }
  }
  return widths;
}

// The columns that remain, in order: while the table is too wide, the one with
// the highest `spare` is dropped, the leftmost of several. Columns with 0
// always remain.
std::vector<std::size_t> TextTable::Shown(
    const std::vector<std::size_t>& widths, std::size_t width) const {
  std::vector<std::size_t> shown(columns_.size());
  std::iota(shown.begin(), shown.end(), 0);
  const auto needed = [&] {
    return std::accumulate(
        shown.begin(), shown.end(), std::size_t{0},
        [&](std::size_t sum, std::size_t c) { return sum + widths[c] + kGap; });
  };
  while (width > 0 && needed() > width + kGap) {
    const auto most_spare = std::max_element(
        shown.begin(), shown.end(), [this](std::size_t a, std::size_t b) {
          return columns_[a].spare < columns_[b].spare;
        });
    if (columns_[*most_spare].spare == 0) {
      break;
    }
    shown.erase(most_spare);
  }
  return shown;
}

void TextTable::Print(std::ostream& out, const TextStyle& style) const {
  std::vector<std::size_t> widths = Widths();
  std::vector<std::size_t> shown(columns_.size());
  std::iota(shown.begin(), shown.end(), 0);
  if (style.width > 0) {
    const std::vector<std::size_t> whole = std::exchange(widths, Least(widths));
    shown = Shown(widths, style.width);
    std::size_t needed = kGap * (shown.size() - 1);
    for (const std::size_t c : shown) {
      needed += widths[c];
    }
    for (const std::size_t c : shown) {
      const std::size_t room = style.width - std::min(needed, style.width);
      const std::size_t more = std::min(whole[c] - widths[c], room);
      widths[c] += more;
      needed += more;
    }
  }
  const auto print = [&](const auto& cell_of, const auto& code_of) {
    for (const std::size_t c : shown) {
      const bool last = c == shown.back();
      // No trailing blanks: they could wrap on a terminal.
      const bool bare = last && columns_[c].align == Align::kLeft;
      const std::string text = Padded(Shortened(cell_of(c), widths[c]),
                                      bare ? 0 : widths[c], columns_[c].align);
      out << Toned(text, code_of(c), style.colour)
          << (last ? "\n" : std::string(kGap, ' '));
    }
  };
  print([&](std::size_t c) { return columns_[c].heading; },
        [](std::size_t) { return kBold; });
  for (const Row& row : rows_) {
    print([&](std::size_t c) { return row.cells[c]; },
          [&](std::size_t c) { return ToneCode(row.tones[c]); });
  }
  // Names the omitted columns, so that they are not taken for missing data.
  std::string left_out;
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    if (std::find(shown.begin(), shown.end(), c) == shown.end()) {
      left_out += (left_out.empty() ? "" : ", ") + columns_[c].heading;
    }
  }
  if (!left_out.empty()) {
    out << Toned("(too narrow for: " + left_out + ")", ToneCode(Tone::kQuiet),
                 style.colour)
        << '\n';
  }
}

std::string TextTable::Text() const {
  std::ostringstream out;
  Print(out);
  std::string text = out.str();
  text.pop_back();
  return text;
}

std::size_t TextWidth(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (c & '\xC0') != '\x80'; }));
}

std::string Shortened(const std::string& text, std::size_t width) {
  if (TextWidth(text) <= width) {
    return text;
  }
  std::size_t end = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if ((text[i] & '\xC0') != '\x80' && width-- == 1) {
      end = i;
      break;
    }
  }
  return text.substr(0, end) + "…";
}

std::string FormatNumber(double value, int decimals) {
  if (!std::isfinite(value)) {
    return "-";
  }
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace fdi::report
