#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include "base/correlation.h"
#include "base/error.h"
#include "base/log.h"
#include "import/csv.h"

// Whole tables: properties that only all rows reveal, i.e. the decimal sign and
// the time grid.

namespace fdi::importer {
namespace {

/// Tolerance of time steps, as a share of the period.
constexpr double kStepTolerance = 0.01;
/// Share of the period; less than half, since a row in the middle is ambiguous.
constexpr double kMaxGridShift = 0.499;

std::string PercentText(std::size_t part, std::size_t whole) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %%",
                100.0 * static_cast<double>(part) / static_cast<double>(whole));
  return text;
}

std::vector<std::string_view> Lines(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    lines.push_back(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return lines;
}

SampleSeries EmptyRun(const CsvHeader& header, double period_s) {
  SampleSeries run;
  run.flow_unit = header.flow_unit;
  run.period_s = period_s;
  run.has_truth = header.has_truth;
  run.signals = header.signals;
  return run;
}

// Detects the decimal sign from all cells of the table.
// Every cell is evidence (Digits): "12.34" shows a decimal sign, "1.234" may be
// a decimal or a thousand, and "1.234.567" has thousands. Contradictions are
// refused, and so is a table of ambiguous cells only, unless commas separate
// them and all signs are points: a wrong guess would be off by a factor of
// 1000.
char FindDecimal(const std::vector<std::string_view>& lines, std::size_t begin,
                 char separator, const std::string& source) {
  struct Seen {
    std::string cell;
    std::size_t line{0};
  };
  std::map<char, Seen> decimal;
  std::map<char, Seen> either;
  CsvCells record(separator);
  const auto refuse = [&](const Seen& seen, const std::string& reason) {
    throw DataError(source + ":" + std::to_string(seen.line) + ": " +
                    Quoted(seen.cell) + reason +
                    "; try decimal = \".\" or decimal = \",\" under [file] "
                    "of --map, or export without thousands separators");
  };
  for (std::size_t i = begin; i < lines.size(); ++i) {
    if (!record.TakeLine(lines[i])) {
      continue;
    }
    for (const std::string& cell : record.cells()) {
      char sign = '.';
      switch (DigitsOf(cell, sign)) {
        case Digits::kDecimal:
          decimal.try_emplace(sign, Seen{cell, i + 1});
          break;
        case Digits::kEither:
          either.try_emplace(sign, Seen{cell, i + 1});
          break;
        case Digits::kThousands:
          refuse({cell, i + 1},
                 " has thousands separators; expected digits "
                 "with one decimal sign");
          break;
        case Digits::kNone:
          break;
      }
    }
  }
  if (decimal.size() == 2) {
    const Seen& later =
        decimal['.'].line < decimal[','].line ? decimal[','] : decimal['.'];
    refuse(later,
           " and cells above differ in the sign of decimals; expected "
           "one of point and comma throughout");
  }
  if (decimal.empty() && either.size() == 1 &&
      (separator != ',' || either.contains(','))) {
    refuse(either.begin()->second,
           " and all other cells may have decimals or thousands; expected to "
           "know which");
  }
  const char sign = !decimal.empty() ? decimal.begin()->first : '.';
  const char other = sign == '.' ? ',' : '.';
  if (either.contains(other)) {
    refuse(either[other], " seems to have a thousands separator");
  }
  return sign;
}

}  // namespace

ColumnMap WithSigns(std::string_view text, ColumnMap map,
                    const std::string& source) {
  const std::vector<std::string_view> lines = Lines(text);
  // The header and the first row after it; blank lines do not count.
  std::vector<std::string_view> first;
  const auto begin = static_cast<std::size_t>(map.skip);
  for (std::size_t i = begin; i < lines.size() && first.size() < 2; ++i) {
    if (lines[i].starts_with("sep=") && first.empty()) {
      map.separator = lines[i].size() > 4 ? lines[i][4] : ',';
    } else if (lines[i].find_first_not_of(" \t\r") != std::string_view::npos) {
      first.push_back(lines[i]);
    }
  }
  first.resize(2);
  if (map.separator == '\0') {
    map.separator = FindSeparator(first[0], first[1]);
  }
  if (map.decimal == '\0') {
    map.decimal = FindDecimal(lines, begin, map.separator, source);
  }
  return map;
}

namespace {

struct TimedReading {
  double t_s;
  double value;
  SignalQuality quality;
};

// Reads the rows of a whole table and aligns them to a time grid.
class TableReader {
 public:
  TableReader(std::string_view text, const CsvOptions& options)
      : lines_(Lines(text)), reader_(Settled(text, options)) {}

  CsvTable Read();

 private:
  static CsvOptions Settled(std::string_view text, CsvOptions options) {
    options.map = WithSigns(text, std::move(options.map), options.source);
    return options;
  }
  void TakeRows();
  void JoinTags();
  void CheckOrder() const;
  void FindPeriod();
  bool IsSteady() const;
  void PutOnGrid();
  std::array<std::vector<TimedReading>, kSignalCount> Readings() const;
  void NoteResampling(const std::array<std::size_t, kSignalCount>& filled,
                      std::size_t samples);
  void Resample();
  void CheckValues();
  void CheckPair(Signal signal);
  void Cut();
  [[noreturn]] void RefuseAt(std::int64_t line,
                             const std::string& reason) const {
    throw DataError(options().source + ":" + std::to_string(line) + ": " +
                    reason);
  }
  [[noreturn]] void RefuseStep(std::size_t k) const;
  // Offset of the rows from a grid that begins at the first one [s].
  double Phase() const;
  const CsvOptions& options() const { return reader_.options(); }
  bool MayHaveGaps() const {
    return options().split_gaps || options().map.resampling;
  }

  std::vector<std::string_view> lines_;
  CsvReader reader_;
  std::vector<CsvRow> rows_;
  double period_s_{0.0};
  CsvTable table_;
};

// The order of the steps matters: tags are joined before the order in time is
// checked, since a long table may be sorted by tag; the period is found from
// ordered rows; and runs are cut on the final grid.
CsvTable TableReader::Read() {
  TakeRows();
  table_.header = reader_.header();
  table_.dated = reader_.dated();
  table_.notes = reader_.notes();
  if (options().map.decimal == ',') {
    table_.notes.insert(table_.notes.begin(), "decimal sign: comma (found)");
  }
  if (!table_.header.ignored_columns.empty()) {
    table_.notes.push_back("not used: " +
                           Listed(table_.header.ignored_columns));
  }
  for (const ColumnMapping& m : options().map.columns) {
    if (!m.unit.empty()) {
      table_.notes.push_back(
          std::string(SignalName(m.signal)) + " = " + m.column + " in " +
          m.unit + (m.sense == Sense::kOpening ? ", opening" : "") + ": " +
          NumberText(m.offset) + " + " + NumberText(m.scale) + " x cell" +
          (m.sense == Sense::kOpening ? ", from 100" : ""));
    }
  }
  if (reader_.options().map.long_table) {
    JoinTags();
  }
  CheckOrder();
  CheckValues();
  FindPeriod();
  table_.start_ns = table_.dated ? rows_.front().labelled.sample.stamp_ns
                                 : options().start_ns;
  if (options().map.resampling) {
    Resample();
  } else if (!IsSteady()) {
    PutOnGrid();
  }
  Cut();
  for (const std::string& note : table_.notes) {
    if (options().log) {
      options().log(LogLevel::kInfo,
                    EventLine("csv_note",
                              {{"source", options().source}, {"note", note}}));
    }
  }
  return std::move(table_);
}

void TableReader::TakeRows() {
  for (const std::string_view line : lines_) {
    if (auto row = reader_.TakeLine(line)) {
      rows_.push_back(std::move(*row));
    }
  }
  reader_.Finish();
}

// Merges rows of the same instant; a long table may be sorted by tag.
void TableReader::JoinTags() {
  std::ranges::stable_sort(rows_, {}, [](const CsvRow& row) {
    return row.labelled.sample.stamp_ns;
  });
  std::vector<CsvRow> joined;
  for (const CsvRow& row : rows_) {
    const Sample& part = row.labelled.sample;
    if (joined.empty() ||
        joined.back().labelled.sample.stamp_ns != part.stamp_ns) {
      joined.push_back(row);
      continue;
    }
    Sample& whole = joined.back().labelled.sample;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      const auto signal = static_cast<Signal>(i);
      if (!part.Has(signal)) {
        continue;
      }
      if (whole.Has(signal) && whole[signal] != part[signal]) {
        RefuseAt(row.line, "signal " + std::string(SignalName(signal)) +
                               " has two values at this time, " +
                               NumberText(whole[signal]) + " and " +
                               NumberText(part[signal]) +
                               "; expected one; try another zone, or remove "
                               "one of the rows");
      }
      whole.Set(signal, part[signal]);
      whole.quality[i] = part.quality[i];
    }
  }
  rows_ = std::move(joined);
  // The reader counted from the first row of the file, which need not be the
  // earliest.
  const double first_s = rows_.empty() ? 0.0 : rows_.front().t_s;
  for (CsvRow& row : rows_) {
    row.t_s -= table_.dated ? first_s : 0.0;
  }
}

void TableReader::CheckOrder() const {
  for (std::size_t k = 1; k < rows_.size(); ++k) {
    if (rows_[k].t_s <= rows_[k - 1].t_s) {
      RefuseAt(rows_[k].line,
               "time goes back or stands still: from " +
                   NumberText(rows_[k - 1].t_s) + " s to " +
                   NumberText(rows_[k].t_s) +
                   " s; expected rows in the order of time; try to sort the "
                   "file, or --zone if clocks went back");
    }
  }
}

// The median step, which is the period if most steps are one. Jitter blurs it,
// so a nearby round value is preferred.
void TableReader::FindPeriod() {
  period_s_ = options().map.resampling ? options().map.resampling->period_s
                                       : options().period_s;
  if (period_s_ > 0.0) {
    return;
  }
  if (rows_.size() < 2) {
    throw DataError(options().source +
                    ": one row does not tell the sample period; try --period");
  }
  std::vector<double> steps;
  for (std::size_t k = 1; k < rows_.size(); ++k) {
    steps.push_back(rows_[k].t_s - rows_[k - 1].t_s);
  }
  // Of two middle steps the shorter one: a gap must not become the period of a
  // short table.
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  period_s_ = *middle;
  if (IsSteady()) {
    return;
  }
  // Steady tables keep their exact step, however odd. Only steps with jitter
  // are taken for a blurred round period.
  for (const double round : {0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0,
                             10.0, 12.0, 15.0, 20.0, 30.0, 60.0, 120.0}) {
    if (std::abs(period_s_ - round) < 0.05 * round) {
      period_s_ = round;
    }
  }
}

// Whether every step is one period, or a gap where gaps are allowed.
bool TableReader::IsSteady() const {
  for (std::size_t k = 1; k < rows_.size(); ++k) {
    const double off = rows_[k].t_s - rows_[k - 1].t_s - period_s_;
    // Half a period too much, or more, is a gap. What is less is jitter, which
    // PutOnGrid() removes.
    if (std::abs(off) > kStepTolerance * period_s_ &&
        !(MayHaveGaps() && off >= 0.5 * period_s_)) {
      return false;
    }
  }
  return true;
}

void TableReader::RefuseStep(std::size_t k) const {
  const double step = rows_[k].t_s - rows_[k - 1].t_s;
  RefuseAt(rows_[k].line,
           "time jumps by " + NumberText(std::round(step * 1e6) / 1e6) +
               " s to " + NumberText(std::round(rows_[k].t_s * 1e6) / 1e6) +
               " s, the sample period is " + NumberText(period_s_) + " s" +
               (step > period_s_
                    ? "; try --split-gaps, which begins a new run at a gap, or "
                    : "; expected rows less than half a period off; try ") +
               "--resample " + NumberText(period_s_) + "s:linear");
}

// The first row may be early or late itself, so the grid does not begin there.
// With remainders in [-T/2, T/2] of all rows against it, the median is the
// shift that most rows agree on, and outliers do not move it.
double TableReader::Phase() const {
  std::vector<double> off;
  for (const CsvRow& row : rows_) {
    off.push_back(std::remainder(row.t_s - rows_.front().t_s, period_s_));
  }
  const auto middle = off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2);
  std::nth_element(off.begin(), middle, off.end());
  return *middle;
}

void TableReader::PutOnGrid() {
  const double begin_s = rows_.front().t_s + Phase();
  std::int64_t last = 0;
  double largest = 0.0;
  // A copy, so that RefuseStep() shows the times that the file has.
  std::vector<CsvRow> placed = rows_;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const std::int64_t at = std::llround((rows_[k].t_s - begin_s) / period_s_);
    const double grid_s = begin_s + static_cast<double>(at) * period_s_;
    // Each row needs an instant of its own, the next one unless gaps are
    // allowed. Two rows on one instant would silently lose a sample.
    if (k > 0 &&
        (at <= last || (at > last + 1 && !MayHaveGaps()) ||
         std::abs(grid_s - rows_[k].t_s) > kMaxGridShift * period_s_)) {
      RefuseStep(k);
    }
    last = at;
    CsvRow& row = placed[k];
    row.t_s = grid_s;
    const double moved_s = row.t_s - rows_[k].t_s;
    largest = std::max(largest, std::abs(moved_s));
    row.labelled.sample.stamp_ns += std::llround(moved_s * 1e9);
  }
  rows_ = std::move(placed);
  table_.notes.push_back("rows up to " + NumberText(std::round(largest * 1e3)) +
                         " ms early or late put onto a grid of " +
                         NumberText(period_s_) + " s");
}

// One signal at one instant of the grid.
struct Resampled {
  double value;
  bool filled;
};

// `next` is the first reading behind t_s.
std::optional<Resampled> At(const std::vector<TimedReading>& readings,
                            std::size_t next, double t_s,
                            const Resampling& how) {
  const TimedReading* after =
      next < readings.size() ? &readings[next] : nullptr;
  const TimedReading* before = next > 0 ? &readings[next - 1] : nullptr;
  const auto near = [&](const TimedReading* r) {
    return r != nullptr && std::abs(r->t_s - t_s) <= 0.5 * how.period_s;
  };
  // A nearby reading is used unchanged, as without resampling.
  if (near(before) || near(after)) {
    const bool later =
        near(after) && (!near(before) || after->t_s - t_s < t_s - before->t_s);
    const TimedReading& nearest = later ? *after : *before;
    return Resampled{nearest.value, nearest.quality != SignalQuality::kGood};
  }
  // A line over two periods bridges a single missing sample, whatever the limit
  // says.
  if (before != nullptr && after != nullptr && how.linear &&
      after->t_s - before->t_s <= std::max(how.limit_s, 2.0 * how.period_s)) {
    const double share = (t_s - before->t_s) / (after->t_s - before->t_s);
    return Resampled{before->value + share * (after->value - before->value),
                     true};
  }
  if (before != nullptr && !how.linear && t_s - before->t_s <= how.limit_s) {
    return Resampled{before->value, true};
  }
  return std::nullopt;
}

// The readings of each signal, ordered by time.
std::array<std::vector<TimedReading>, kSignalCount> TableReader::Readings()
    const {
  std::array<std::vector<TimedReading>, kSignalCount> readings;
  for (const CsvRow& row : rows_) {
    const Sample& sample = row.labelled.sample;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      if (sample.Has(static_cast<Signal>(i))) {
        readings[i].push_back({row.t_s, sample.values[i], sample.quality[i]});
      }
    }
  }
  return readings;
}

void TableReader::NoteResampling(
    const std::array<std::size_t, kSignalCount>& filled, std::size_t samples) {
  const Resampling& how = *options().map.resampling;
  std::string shares;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    if (filled[i] > 0) {
      shares += (shares.empty() ? "" : ", ") +
                std::string(SignalName(static_cast<Signal>(i))) + " " +
                PercentText(filled[i], samples);
    }
  }
  table_.notes.push_back(
      "resampled to " + NumberText(period_s_) + " s (" +
      (how.linear ? "linear" : "hold") + ", at most " +
      NumberText(how.limit_s) +
      " s), filled: " + (shares.empty() ? "nothing" : shares) +
      (shares.empty() ? "" : "; kept out of fits and thresholds"));
}

// One pass over the grid with one cursor per signal: O(samples + readings).
// Each signal is resampled from its own readings, because the tags of a long
// table are read at different times. Truth and mode are those of the last row
// up to half a period after the instant.
void TableReader::Resample() {
  const Resampling& how = *options().map.resampling;
  const double begin_s = rows_.front().t_s + Phase();
  const double length_s = rows_.back().t_s - begin_s + 0.5 * period_s_;
  // A period in the wrong unit would otherwise end only with the memory.
  if (length_s / period_s_ > 1e8) {
    throw ConfigError("--resample " + NumberText(period_s_) +
                      "s: more than 100 million samples");
  }
  const auto readings = Readings();
  std::array<std::size_t, kSignalCount> next{};
  std::array<std::size_t, kSignalCount> filled{};
  std::vector<CsvRow> grid;
  std::size_t row = 0;
  const CsvRow origin = rows_.front();
  for (std::int64_t k = 0; static_cast<double>(k) * period_s_ <= length_s;
       ++k) {
    const double t_s = begin_s + static_cast<double>(k) * period_s_;
    while (row + 1 < rows_.size() &&
           rows_[row + 1].t_s <= t_s + 0.5 * period_s_) {
      ++row;
    }
    CsvRow made;
    made.t_s = t_s;
    made.line = rows_[row].line;
    made.labelled.truth = rows_[row].labelled.truth;
    Sample& sample = made.labelled.sample;
    sample.mode = rows_[row].labelled.sample.mode;
    sample.flow_unit = table_.header.flow_unit;
    sample.stamp_ns = origin.labelled.sample.stamp_ns +
                      std::llround((t_s - origin.t_s) * 1e9);
    std::array<bool, kSignalCount> is_filled{};
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      while (next[i] < readings[i].size() && readings[i][next[i]].t_s <= t_s) {
        ++next[i];
      }
      if (const auto value = At(readings[i], next[i], t_s, how)) {
        sample.Set(static_cast<Signal>(i), value->value);
        is_filled[i] = value->filled;
        sample.quality[i] =
            value->filled ? SignalQuality::kUncertain : SignalQuality::kGood;
      }
    }
    if (!sample.Has(Signal::kCv) ||
        (!sample.Has(Signal::kX) && !sample.Has(Signal::kF))) {
      // Otherwise a gap of months would be walked through instant by instant.
      if (row + 1 < rows_.size() && rows_[row + 1].t_s > t_s + period_s_) {
        // Continue after the gap.
        k = std::max(k, static_cast<std::int64_t>(std::floor(
                            (rows_[row + 1].t_s - begin_s) / period_s_)) -
                            1);
      }
      continue;
    }
    sample.seq = grid.size();
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      filled[i] += is_filled[i] ? 1U : 0U;
    }
    grid.push_back(std::move(made));
  }
  if (grid.empty()) {
    throw DataError(options().source +
                    ": no instant has CV and one of X, F; try a longer age, "
                    "--resample " +
                    NumberText(period_s_) + "s:hold:10min");
  }
  NoteResampling(filled, grid.size());
  rows_ = std::move(grid);
}

// A signal that is impossible most of the time was probably converted wrongly.
void TableReader::CheckValues() {
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    const SignalRange range = PlausibleRange(signal);
    std::size_t count = 0;
    std::size_t beyond = 0;
    const CsvRow* first = nullptr;
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const CsvRow& row : rows_) {
      const Sample& sample = row.labelled.sample;
      if (!sample.Has(signal)) {
        continue;
      }
      ++count;
      low = std::min(low, sample[signal]);
      high = std::max(high, sample[signal]);
      if (!range.Contains(sample[signal])) {
        first = first == nullptr ? &row : first;
        ++beyond;
      }
    }
    const std::string name(SignalName(signal));
    // Single impossible readings are left to the diagnosis, which refuses such
    // samples. A mapped signal is refused, because the map states the
    // conversion; others are only noted.
    if (2 * beyond > count) {
      const std::string what =
          name + " is " + NumberText(first->labelled.sample[signal]) +
          " after conversion, and beyond " + NumberText(range.minimum) + ".." +
          NumberText(range.maximum) + " " + std::string(SignalUnit(signal)) +
          " in " + PercentText(beyond, count) +
          " of the rows; try unit, scale "
          "and span under [signal." +
          name + "] of --map";
      if (std::ranges::find(options().map.columns, signal,
                            &ColumnMapping::signal) !=
          options().map.columns.end()) {
        RefuseAt(first->line, what);
      }
      table_.notes.push_back(what);
    }
    if (signal == Signal::kX || signal == Signal::kP2) {
      CheckPair(signal);
    }
    const bool percent = signal == Signal::kCv || signal == Signal::kX;
    if (percent && count > 20 && low >= 0.0 && high <= 1.0 && low < high) {
      table_.notes.push_back(name +
                             " stays within 0..1 %: a fraction? unit = "
                             "\"1\" under [signal." +
                             name + "] of --map says so");
    }
  }
}

// A flow that falls as the valve opens, or that runs against the pressure,
// indicates a wrong sense or swapped columns.
void TableReader::CheckPair(Signal signal) {
  CorrelationSums sums;
  std::size_t count = 0;
  std::size_t against = 0;
  for (const CsvRow& row : rows_) {
    const Sample& s = row.labelled.sample;
    if (s.Has(Signal::kX) && s.Has(Signal::kF)) {
      sums.Add(s[Signal::kX], s[Signal::kF]);
    }
    if (s.Has(Signal::kP1) && s.Has(Signal::kP2)) {
      ++count;
      against += s[Signal::kP2] > s[Signal::kP1] ? 1U : 0U;
    }
  }
  if (signal == Signal::kX && rows_.size() > 20 && sums.Correlation() > 0.5) {
    table_.notes.push_back(
        "F rises with X, which counts in % of closing: is it % of opening? "
        "sense = \"opening\" under [signal.X] and [signal.CV] of --map says "
        "so");
  }
  if (signal == Signal::kP2 && 2 * against > count) {
    table_.notes.push_back("P2 is above P1 in " + PercentText(against, count) +
                           " of the rows: are the columns exchanged?");
  }
}

void TableReader::Cut() {
  std::size_t gaps = 0;
  double missing_s = 0.0;
  double longest_s = 0.0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const double step = k == 0 ? 0.0 : rows_[k].t_s - rows_[k - 1].t_s;
    // The limit between jitter and a gap is that of IsSteady().
    const bool gap = step > 1.5 * period_s_;
    if (gap) {
      ++gaps;
      missing_s += step - period_s_;
      longest_s = std::max(longest_s, step - period_s_);
    }
    if (k == 0 || gap) {
      table_.runs.push_back(EmptyRun(table_.header, period_s_));
    }
    table_.runs.back().samples.push_back(std::move(rows_[k].labelled));
  }
  if (gaps > 0) {
    table_.notes.push_back(std::to_string(gaps) + " gaps, " +
                           NumberText(std::round(missing_s)) +
                           " s without samples, the longest " +
                           NumberText(std::round(longest_s)) + " s");
  }
}

}  // namespace

CsvTable ReadCsv(std::string_view text, const CsvOptions& options) {
  return TableReader(text, options).Read();
}

CsvTable ReadCsvFile(const std::filesystem::path& path, CsvOptions options) {
  options.source = path == "-" ? "stdin" : path.string();
  return ReadCsv(ReadTextFile(path), options);
}

}  // namespace fdi::importer
