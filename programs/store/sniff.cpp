// fdi-store runs sniff: analyses an exported file and proposes a tag map.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "base/correlation.h"
#include "base/error.h"
#include "import/csv.h"
#include "import/tag_map.h"
#include "programs/store/verbs.h"

namespace fdi::storage {
namespace {

// A column, or a tag of a long table.
struct SniffedColumn {
  std::string name;
  std::vector<double> times_s;
  std::vector<double> values;
  std::size_t cells{0};
  std::size_t missing{0};
  std::size_t words{0};  // Neither numbers nor known words for "no reading".
  std::set<std::string> texts{};
  std::optional<Signal> signal{};
  std::string unit{};
  bool opening{false};
  std::string guessed{};  // Reasons, and what is uncertain.

  double Median() const {
    std::vector<double> sorted = values;
    const auto middle =
        sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    return *middle;
  }
  double Min() const { return *std::ranges::min_element(values); }
  double Max() const { return *std::ranges::max_element(values); }
};

struct Sniffed {
  importer::ColumnMap map;
  std::size_t rows{0};
  std::vector<double> times_s;
  std::string date{};  // The column of [time].
  bool dated{false};
  std::string time_guess{};
  std::vector<SniffedColumn> columns;
  std::string resample{};
  double period_s{0.0};
  double jitter_s{0.0};
  std::size_t gaps{0};
  double longest_gap_s{0.0};
  bool compressed{false};
};

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return lower;
}

bool Has(std::string_view text, std::initializer_list<const char*> words) {
  return std::ranges::any_of(words, [&](const char* word) {
    return text.find(word) != std::string_view::npos;
  });
}

double MedianStep(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    steps.push_back(times_s[k] - times_s[k - 1]);
  }
  if (steps.empty()) {
    return 0.0;
  }
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

// The unit in a name: "bar g" of "PT101 [bar g]" or "P1 (bar g)", "t/h" of
// "F_t_h"; else empty.
std::string UnitInName(Signal signal, std::string_view name) {
  const std::size_t open = name.find_first_of("[(");
  const std::size_t close = name.find_last_of("])");
  std::vector<std::string> candidates;
  if (open != std::string_view::npos && close != std::string_view::npos &&
      close > open) {
    candidates.emplace_back(name.substr(open + 1, close - open - 1));
  }
  // All candidates are tried, because only a unit of that signal is accepted:
  // "F_t_h" gives "t/h".
  if (const std::size_t at = name.rfind(' '); at != std::string_view::npos) {
    candidates.emplace_back(name.substr(at + 1));
  }
  for (std::size_t at = name.find('_'); at != std::string_view::npos;
       at = name.find('_', at + 1)) {
    candidates.emplace_back(name.substr(at + 1));
    std::ranges::replace(candidates.back(), '_', '/');
  }
  for (const std::string& unit : candidates) {
    // "1" is a unit of percentages, but at the end of a name it is a number of
    // a loop.
    if (!unit.empty() && unit != "1" && importer::FindUnit(signal, unit)) {
      return unit;
    }
  }
  return {};
}

// Guesses the signal from ISA 5.1 tag letters and common words. Both pressures
// are P1 until their sizes tell them apart.
std::optional<Signal> SignalOfName(const std::string& name) {
  std::string plain = Lower(name.substr(0, name.find_first_of("[(")));
  while (!plain.empty() && plain.back() == ' ') {
    plain.pop_back();
  }
  for (const importer::SignalColumn& known : importer::kSignalColumns) {
    if (SameName(known.name, name)) {
      return known.signal;
    }
  }
  const auto ends = [&](std::initializer_list<const char*> words) {
    return std::ranges::any_of(
        words, [&](const char* w) { return plain.ends_with(w); });
  };
  // The order settles names that hold several words: a "flow setpoint" is a
  // setpoint, a "position output" a command, a "supply pressure" no P1. Letters
  // of a tag come last, because words are more certain.
  if (Has(plain, {"setpoint", "set point"}) || ends({".sp", "_sp", " sp"})) {
    return Signal::kSp;
  }
  if (Has(plain, {"command", "demand", "output", "stellsig", "setpos"}) ||
      ends({"cv", ".op", "_op", " op", ".out", "_out", "mv", ".co", "_co"})) {
    return Signal::kCv;
  }
  if (Has(plain, {"position", "travel", "stem", "opening", "hub", "stellung",
                  "feedback"}) ||
      ends({"x", "pos", ".zt", "zi", "fb"})) {
    return Signal::kX;
  }
  if (Has(plain, {"supply", "air"})) {
    return Signal::kPz;
  }
  if (Has(plain, {"press", "druck"})) {
    return Signal::kP1;
  }
  if (Has(plain, {"temp"})) {
    return Signal::kT1;
  }
  if (Has(plain, {"flow", "durchfl", "menge"})) {
    return Signal::kF;
  }
  // The letters in front of the loop number: FIC in "20.FIC101".
  const std::size_t digit = plain.find_last_of("0123456789");
  std::size_t end = digit == std::string::npos ? plain.size() : digit;
  while (end > 0 && !std::isalpha(static_cast<unsigned char>(plain[end - 1]))) {
    --end;
  }
  std::size_t begin = end;
  while (begin > 0 &&
         std::isalpha(static_cast<unsigned char>(plain[begin - 1]))) {
    --begin;
  }
  const std::string letters = plain.substr(begin, end - begin);
  if (letters.empty() || letters.size() > 4) {
    return std::nullopt;
  }
  switch (letters.front()) {
    case 'p':
      return Signal::kP1;
    case 't':
      return Signal::kT1;
    case 'f':
      return Signal::kF;
    // Position is Z in ISA 5.1 and G in DIN 19227.
    case 'z':
    case 'g':
      return Signal::kX;
    default:
      return std::nullopt;
  }
}

// Without a unit in the name, size decides: CV, X and SP up to 1.1 are
// fractions, T1 between 250 and 450 is in K, and pressures are in Pa above 2e4,
// in kPa above 100, else in bar. Of a flow, size tells nothing.
void GuessUnit(SniffedColumn& column) {
  column.unit = UnitInName(*column.signal, column.name);
  if (!column.unit.empty()) {
    return;
  }
  const double median = std::abs(column.Median());
  switch (*column.signal) {
    case Signal::kCv:
    case Signal::kX:
    case Signal::kSp:
      column.unit = column.Min() >= -0.1 && column.Max() <= 1.1 ? "1" : "%";
      break;
    case Signal::kF:
      column.unit = "m3/h";
      break;
    case Signal::kT1:
      column.unit = median > 250.0 && median < 450.0 ? "K" : "degC";
      break;
    case Signal::kCvi:
      column.unit = "1";
      break;
    default:
      column.unit = median > 2e4 ? "Pa" : median > 100.0 ? "kPa" : "bar";
  }
  column.guessed += "unit by size; ";
}

// Correlation of b with a delayed by 0, 1 or 2 periods, the strongest.
// The delays allow for the lag of the rod behind the command, and of the flow
// behind the rod. The sign is kept, because the sense follows from it.
double Correlation(const SniffedColumn& a, const SniffedColumn& b) {
  std::map<double, double> at;
  for (std::size_t k = 0; k < a.values.size(); ++k) {
    at[a.times_s[k]] = a.values[k];
  }
  double strongest = 0.0;
  for (int lag = 0; lag <= 2; ++lag) {
    CorrelationSums sums;
    for (std::size_t k = static_cast<std::size_t>(lag); k < b.values.size();
         ++k) {
      // In a compressed table, the last reading remains valid.
      const auto after =
          at.upper_bound(b.times_s[k - static_cast<std::size_t>(lag)]);
      if (after != at.begin()) {
        sums.Add(std::prev(after)->second, b.values[k]);
      }
    }
    const double r = sums.Correlation();
    strongest = std::abs(r) > std::abs(strongest) ? r : strongest;
  }
  return strongest;
}

// Signals by name, at most one column each; then units and senses.
void GuessSignals(std::vector<SniffedColumn>& columns) {
  for (SniffedColumn& column : columns) {
    // A column that is mostly words is no reading, whatever its name says.
    if (column.values.empty() || column.words > column.values.size()) {
      continue;
    }
    column.signal = SignalOfName(column.name);
  }
  const auto of = [&](Signal signal) {
    std::vector<SniffedColumn*> found;
    for (SniffedColumn& column : columns) {
      if (column.signal == signal) {
        found.push_back(&column);
      }
    }
    return found;
  };
  // The pressure falls in the direction of flow. A column named P2, as in the
  // import format, stays P2.
  std::vector<SniffedColumn*> pressures = of(Signal::kP1);
  if (pressures.size() == 2 && of(Signal::kP2).empty()) {
    SniffedColumn* low = pressures[0]->Median() < pressures[1]->Median()
                             ? pressures[0]
                             : pressures[1];
    low->signal = Signal::kP2;
    for (SniffedColumn* column : pressures) {
      column->guessed += "P1 is the higher pressure; ";
    }
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    const std::vector<SniffedColumn*> found = of(signal);
    for (std::size_t k = 1; k < found.size(); ++k) {
      found[k]->signal.reset();
      found[k]->guessed = "another " + std::string(SignalName(signal)) + "?";
    }
    if (!found.empty()) {
      GuessUnit(*found.front());
    }
  }
  // The flow rises with the opening, and follows the rod more closely than it
  // follows the command.
  const auto flow = of(Signal::kF);
  const auto cv = of(Signal::kCv);
  std::vector<SniffedColumn*> moving = of(Signal::kX);
  moving.insert(moving.end(), cv.begin(), cv.end());
  // Only the first one, X if there is one, is compared with the flow. The
  // others are compared with it: CV and X are alike but for the sense, so that
  // correlation is strong where that with the flow may be weak. 0.3 is the
  // limit of onboarding, too (docs/onboarding.md).
  for (SniffedColumn* column : moving) {
    const bool led = column != moving.front();
    const double r = led            ? Correlation(*column, *moving.front())
                     : flow.empty() ? 0.0
                                    : Correlation(*column, *flow.front());
    column->opening = led ? (r >= 0.0) == moving.front()->opening : r > 0.3;
    column->guessed += led ? std::string("moves ") +
                                 (r >= 0.0 ? "with" : "against") + " the rod; "
                       : r > 0.3  ? "opening: the flow rises with it; "
                       : r < -0.3 ? "closing: the flow falls with it; "
                                  : "sense cannot be told from the flow; ";
  }
  for (SniffedColumn& column : columns) {
    if (column.guessed.ends_with("; ")) {
      column.guessed.resize(column.guessed.size() - 2);
    }
  }
}

// Seconds of a time cell; nothing if it cannot be read as a time.
class TimeReader {
 public:
  explicit TimeReader(const importer::ColumnMap& map)
      : map_(map), clock_(map.zone) {}
  std::optional<double> Read(const std::string& cell) {
    if (const auto number = ParseNumber(cell, map_.decimal)) {
      // Spreadsheet day numbers become seconds. As in the importer, the first
      // row decides.
      if (form_ == importer::TimeForm::kFindOut) {
        form_ = importer::TimeFormOf(map_.time_column, *number);
      }
      const bool serial = form_ == importer::TimeForm::kSerial;
      dated_ = dated_ || serial;
      return serial ? *number * 86400.0 : *number;
    }
    const auto time = ScanTime(cell, map_.date_order);
    if (!time) {
      return std::nullopt;
    }
    const auto utc = clock_.Utc(*time, last_ns_);
    last_ns_ = utc.value_or(last_ns_);
    dated_ = true;
    return utc ? std::optional(static_cast<double>(*utc) * 1e-9) : std::nullopt;
  }
  bool dated() const { return dated_; }

 private:
  const importer::ColumnMap& map_;
  LocalClock clock_;
  std::int64_t last_ns_{0};
  importer::TimeForm form_{importer::TimeForm::kFindOut};
  bool dated_{false};
};

using Cells = std::vector<std::string>;

// The header is the first line after `skip`.
std::vector<Cells> CellsOf(const std::string& text,
                           const importer::ColumnMap& map) {
  std::vector<Cells> rows;
  std::istringstream lines(text);
  CsvCells record(map.separator);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    if (++number <= map.skip || line.starts_with("sep=") ||
        !record.TakeLine(line) || record.blank()) {
      continue;
    }
    rows.push_back(record.cells());
  }
  return rows;
}

// Tells d/m/y from m/d/y, where a number above 12 decides it.
DateOrder OrderOf(const std::vector<Cells>& rows, std::size_t column) {
  bool day_first = true;
  bool month_first = true;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    if (rows[r].size() > column) {
      day_first = day_first && ScanTime(rows[r][column], DateOrder::kDayFirst);
      month_first =
          month_first && ScanTime(rows[r][column], DateOrder::kMonthFirst);
    }
  }
  return day_first == month_first ? DateOrder::kNotSaid
         : day_first              ? DateOrder::kDayFirst
                                  : DateOrder::kMonthFirst;
}

std::optional<std::size_t> FindTime(const std::vector<Cells>& rows,
                                    Sniffed& found) {
  const Cells& header = rows.front();
  for (std::size_t c = 0; c < header.size(); ++c) {
    const std::string& cell = rows[1].size() > c ? rows[1][c] : header[c];
    // `slashed` is any text that is a time in one of the two orders, whatever
    // its column is called. A number is a time only under a name that says so.
    const bool slashed = ScanTime(cell, DateOrder::kDayFirst).has_value() ||
                         ScanTime(cell, DateOrder::kMonthFirst).has_value();
    const std::string name = Lower(header[c]);
    const bool named = Has(name, {"time", "zeit", "date", "datum", "stamp"}) ||
                       name == "t_s" || name == "t";
    if (!slashed && !(named && ParseNumber(cell, found.map.decimal))) {
      continue;
    }
    if (slashed && !ScanTime(cell)) {
      found.map.date_order = OrderOf(rows, c);
      found.date =
          found.map.date_order == DateOrder::kMonthFirst ? "m/d/y" : "d/m/y";
      if (found.map.date_order == DateOrder::kNotSaid) {
        found.map.date_order = DateOrder::kDayFirst;
        found.time_guess = "day before month; ";
      }
    }
    // A date with the time of day in the next column.
    if (slashed && cell.size() <= 11 && c + 1 < header.size() &&
        rows[1].size() > c + 1 &&
        ScanTime(cell + ' ' + rows[1][c + 1], found.map.date_order)) {
      found.map.clock_column = header[c + 1];
    }
    found.map.time_column = header[c];
    return c;
  }
  return std::nullopt;
}

void AddCell(const std::string& cell, double t_s, char decimal,
             SniffedColumn& column) {
  ++column.cells;
  if (importer::IsNoReading(cell)) {
    ++column.missing;
  } else if (const auto value = ParseNumber(cell, decimal)) {
    column.times_s.push_back(t_s);
    column.values.push_back(*value);
  } else {
    ++column.words;
    if (column.texts.size() < 500) {
      column.texts.insert(cell);
    }
  }
}

// A table is long if one column has few distinct names beside one of values.
void FindTags(const std::vector<Cells>& rows, const std::vector<double>& times,
              Sniffed& found) {
  std::vector<SniffedColumn>& columns = found.columns;
  // Tags are words in every row, at least two of them, each in ten rows on
  // average; beside them a long table has value, quality and perhaps one more
  // column.
  const auto tag = std::ranges::find_if(columns, [&](const SniffedColumn& c) {
    return c.words == c.cells && c.texts.size() >= 2 && c.texts.size() < 500 &&
           c.texts.size() * 10 < c.cells && columns.size() <= 4;
  });
  const auto value = std::ranges::find_if(columns, [](const SniffedColumn& c) {
    return c.values.size() * 2 > c.cells;
  });
  if (tag == columns.end() || value == columns.end()) {
    return;
  }
  const Cells& header = rows.front();
  importer::LongTable tall{tag->name, value->name, "", {}};
  for (const SniffedColumn& column : columns) {
    const std::string name = Lower(column.name);
    if (column.name != tall.tag && column.name != tall.value &&
        (Has(name, {"qual", "stat"}) || column.texts.contains("Good"))) {
      tall.quality = column.name;
    }
  }
  const auto at = [&](const std::string& name) {
    return static_cast<std::size_t>(std::ranges::find(header, name) -
                                    header.begin());
  };
  const std::size_t tag_at = at(tall.tag);
  const std::size_t value_at = at(tall.value);
  // From here on the columns are the tags, and GuessSignals() treats both kinds
  // of tables alike.
  std::map<std::string, SniffedColumn> tags;
  for (std::size_t r = 1; r < rows.size(); ++r) {
    if (rows[r].size() == header.size() && !std::isnan(times[r])) {
      SniffedColumn& column = tags[rows[r][tag_at]];
      column.name = rows[r][tag_at];
      AddCell(rows[r][value_at], times[r], found.map.decimal, column);
    }
  }
  columns.clear();
  for (auto& [name, column] : tags) {
    columns.push_back(std::move(column));
  }
  found.map.long_table = std::move(tall);
}

double Rounded(double period_s) {
  for (const double round :
       {0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0}) {
    if (std::abs(period_s - round) < 0.05 * round) {
      return round;
    }
  }
  return period_s;
}

// Period, jitter and gaps, and whether --resample would help.
void JudgeTiming(Sniffed& found) {
  // All stamps together, sorted: a long table has each instant once per tag and
  // may be sorted by tag.
  std::vector<double> times = found.times_s;
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  found.period_s = Rounded(MedianStep(times));
  std::size_t missing = 0;
  for (const SniffedColumn& column : found.columns) {
    missing += column.signal ? column.missing : 0;
    const double usual = MedianStep(column.times_s);
    std::size_t odd = 0;
    for (std::size_t k = 1; k < column.times_s.size(); ++k) {
      const double step = column.times_s[k] - column.times_s[k - 1];
      odd += std::abs(step - usual) > 0.6 * usual ? 1U : 0U;
    }
    // Readings stored by exception or swinging door come at odd steps. A tag
    // with such steps in a fifth of its readings is taken as compressed.
    found.compressed = found.compressed || (found.map.long_table &&
                                            5 * odd > column.times_s.size());
  }
  for (std::size_t k = 1; k < times.size(); ++k) {
    const double step = times[k] - times[k - 1];
    if (step > 1.6 * found.period_s) {
      ++found.gaps;
      found.longest_gap_s = std::max(found.longest_gap_s, step);
    } else {
      found.jitter_s =
          std::max(found.jitter_s, std::abs(step - found.period_s));
    }
  }
  const bool jitter = found.jitter_s > 0.01 * found.period_s;
  double period = found.period_s;
  std::string age;
  // A compressed tag may be silent for long while its value holds, hence ten
  // minutes. Slow and short data are resampled to 1 s, because a record with
  // fewer than 600 samples in a row cannot be onboarded (docs/import.md).
  if (found.compressed) {
    age = ":10min";
    period = std::max(period, 1.0);
  } else if (period > 1.0 && times.size() < 1200) {
    period = 1.0;
    age = ":" + NumberText(3.0 * found.period_s) + "s";
  } else if (!jitter && missing == 0 && found.gaps == 0) {
    return;
  }
  found.resample = NumberText(period) + "s:linear" + age;
}

Sniffed Sniff(const std::string& text, const std::string& source,
              const std::string& zone) {
  Sniffed found;
  found.map.zone = zone;
  found.map = importer::WithSigns(text, std::move(found.map), source);
  const std::vector<Cells> rows = CellsOf(text, found.map);
  if (rows.size() < 3) {
    throw DataError(source + ": expected a header and at least two rows");
  }
  const Cells& header = rows.front();
  const auto time = FindTime(rows, found);
  if (!time) {
    throw DataError(source + ":1: no column of " + Quoted(Listed(header)) +
                    " holds times; expected 2026-11-20 14:56:11, seconds or "
                    "the like");
  }
  std::vector<double> times(rows.size(),
                            std::numeric_limits<double>::quiet_NaN());
  TimeReader reader(found.map);
  const bool split = !found.map.clock_column.empty();
  for (std::size_t c = 0; c < header.size(); ++c) {
    if (c != *time && !(split && c == *time + 1) && !header[c].empty()) {
      found.columns.push_back({header[c], {}, {}});
    }
  }
  for (std::size_t r = 1; r < rows.size(); ++r) {
    if (rows[r].size() != header.size()) {
      continue;  // The importer reports it.
    }
    std::string cell = rows[r][*time];
    cell += split ? ' ' + rows[r][*time + 1] : "";
    const auto t_s = reader.Read(cell);
    if (!t_s) {
      continue;
    }
    ++found.rows;
    times[r] = *t_s;
    found.times_s.push_back(*t_s);
    std::size_t next = 0;
    for (std::size_t c = 0; c < header.size(); ++c) {
      if (c != *time && !(split && c == *time + 1) && !header[c].empty()) {
        AddCell(rows[r][c], *t_s, found.map.decimal, found.columns[next++]);
      }
    }
  }
  found.dated = reader.dated();
  // In this order: tags become columns, columns get signals, and only columns
  // with a signal count for the timing.
  FindTags(rows, times, found);
  GuessSignals(found.columns);
  JudgeTiming(found);
  return found;
}

std::string TomlText(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      std::array<char, 8> code{};  // A name may have several lines.
      std::snprintf(code.data(), code.size(), "\\u%04X", c);
      quoted += code.data();
    } else {
      quoted +=
          c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    }
  }
  return quoted + '"';
}

// The tag map to edit, with guesses marked as such.
std::string MapText(const Sniffed& found, const std::string& file) {
  std::string text = "# Of " + file +
                     ", by fdi-store runs sniff. Check what is guessed.\n"
                     "# docs/import.md explains the keys.\n\n[file]\n";
  const char separator = found.map.separator;
  text += "separator = " +
          TomlText(separator == '\t' ? "tab" : std::string(1, separator)) +
          "\ndecimal = " + TomlText(std::string(1, found.map.decimal)) + "\n";
  if (!found.resample.empty()) {
    text += "resample = " + TomlText(found.resample) + "\n";
  }
  text += "\n[time]\ncolumn = " + TomlText(found.map.time_column) + "\n";
  if (!found.map.clock_column.empty()) {
    text += "clock = " + TomlText(found.map.clock_column) + "\n";
  }
  if (!found.date.empty()) {
    text += "date = " + TomlText(found.date) +
            (found.time_guess.empty() ? "\n" : "  # guessed\n");
  }
  if (found.dated) {
    text +=
        (found.map.zone.empty() ? "# zone = \"Europe/Warsaw\"\n"
                                : "zone = " + TomlText(found.map.zone) + "\n");
  }
  if (found.map.long_table) {
    const importer::LongTable& tall = *found.map.long_table;
    text += "\n[long]\ntag = " + TomlText(tall.tag) +
            "\nvalue = " + TomlText(tall.value) + "\n";
    if (!tall.quality.empty()) {
      text += "quality = " + TomlText(tall.quality) + "\n";
    }
  }
  for (const SniffedColumn& column : found.columns) {
    if (!column.signal) {
      continue;
    }
    text += "\n[signal." + std::string(SignalName(*column.signal)) + "]" +
            (column.guessed.empty() ? "" : "  # guessed: " + column.guessed) +
            "\ncolumn = " + TomlText(column.name) +
            "\nunit = " + TomlText(column.unit) + "\n";
    if (column.opening) {
      text += "sense = \"opening\"\n";
    }
  }
  return text;
}

struct SniffOptions {
  std::string file;
  std::string zone;
  std::string output;
};

Json ColumnJson(const SniffedColumn& column) {
  const bool numbers = !column.values.empty();
  return {{"column", column.name},
          {"signal", column.signal ? Json(SignalName(*column.signal)) : Json()},
          {"unit", column.signal ? Json(column.unit) : Json()},
          {"sense", column.signal != Signal::kCv && column.signal != Signal::kX
                        ? Json()
                    : column.opening ? Json("opening")
                                     : Json("closing")},
          {"min", numbers ? Json(column.Min()) : Json()},
          {"median", numbers ? Json(column.Median()) : Json()},
          {"max", numbers ? Json(column.Max()) : Json()},
          {"missing_share", column.cells == 0
                                ? 0.0
                                : static_cast<double>(column.missing) /
                                      static_cast<double>(column.cells)},
          {"guessed", column.guessed}};
}

Report SniffFile(const SniffOptions& options, const Context&) {
  const Sniffed found =
      Sniff(ReadTextFile(options.file), options.file, options.zone);
  Report report;
  report.document = {
      {"file", options.file},
      {"separator", std::string(1, found.map.separator)},
      {"decimal", std::string(1, found.map.decimal)},
      {"long", found.map.long_table.has_value()},
      {"rows", found.rows},
      {"time_column", found.map.time_column},
      {"period_s", found.period_s},
      {"jitter_s", found.jitter_s},
      {"gaps", found.gaps},
      {"longest_gap_s", found.longest_gap_s},
      {"compressed", found.compressed},
      {"resample", found.resample},
      {"columns", Rows(found.columns, ColumnJson)},
      {"map", options.output.empty() ? Json() : Json(options.output)}};
  report.Fields("",
                {{"separator", "separator"},
                 {"decimal sign", "decimal"},
                 {"long table", "long"},
                 {"rows", "rows"},
                 {"time", "time_column"},
                 {.heading = "period [s]", .key = "period_s", .decimals = 3},
                 {.heading = "jitter [s]", .key = "jitter_s", .decimals = 3},
                 {"gaps", "gaps"},
                 {"longest gap", "longest_gap_s", report::Format::kDuration},
                 {"compressed", "compressed"},
                 {"resample", "resample"}});
  report.Table("columns",
               {{"column", "column"},
                {"signal", "signal"},
                {"unit", "unit"},
                {"sense", "sense"},
                {"min", "min"},
                {"median", "median"},
                {"max", "max"},
                {"missing", "missing_share", report::Format::kPercent},
                {"guessed", "guessed"}});
  if (!options.output.empty()) {
    report::WriteFile(options.output, MapText(found, options.file));
    report.Line("tag map written to " + options.output +
                ": check it, then --map " + options.output);
  }
  return report;
}

}  // namespace

void AddSniffVerb(report::Program& program, CLI::App& group) {
  auto [verb, options] =
      AddVerb(program, group, "sniff",
              "Describe what a file of the plant holds, and write a tag map to "
              "edit",
              SniffFile);
  verb.add_option("file", options.file, "CSV file, also gzipped")->required();
  verb.add_option("--zone", options.zone, "Time zone of times that name none")
      ->type_name("ZONE");
  verb.add_option("--map-output", options.output,
                  "Write a tag map to this file")
      ->type_name("FILE.toml");
}

}  // namespace fdi::storage
