#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <deque>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

#include <malloc.h>

#include "base/correlation.h"
#include "base/error.h"
#include "base/local_sense.h"
#include "base/log.h"
#include "base/median.h"
#include "base/usual_period.h"
#include "diagnosis/model/held_readings.h"
#include "import/csv.h"
#include "import/layout.h"

// Whole tables: properties that only all rows reveal, i.e. the form (layout.h),
// the time grid, and what the readings are like.

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

SampleSeries EmptyRun(const CsvHeader& header, double period_s) {
  SampleSeries run;
  run.flow_unit = header.flow_unit;
  run.period_s = period_s;
  run.has_truth = header.has_truth;
  run.signals = header.signals;
  return run;
}

}  // namespace

// From the end, a clock that goes back in autumn is read in the right order,
// too.
void ForEachRow(const TextLines& lines, CsvReader& reader,
                const std::function<void(CsvRow&&)>& take) {
  const auto take_line = [&](std::string_view line, std::size_t number) {
    if (auto row = reader.TakeLine(line, static_cast<std::int64_t>(number))) {
      take(std::move(*row));
    }
    return true;
  };
  if (!reader.options().map.newest_first) {
    lines.ForEach(take_line);
    return;
  }
  std::size_t begin = 1;
  lines.ForEach([&](std::string_view line, std::size_t number) {
    reader.TakeLine(line, static_cast<std::int64_t>(number));
    begin = number + 1;
    return !reader.in_rows();
  });
  lines.ForEachBackwards(take_line, begin);
}

double MedianStep(const std::vector<double>& times_s) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    steps.push_back(times_s[k] - times_s[k - 1]);
  }
  return ShorterMedian(std::move(steps));
}

namespace {

bool Repeats(const CsvRow& a, const CsvRow& b) {
  const Sample& before = a.labelled.sample;
  const Sample& after = b.labelled.sample;
  return before.present == after.present && before.values == after.values &&
         before.quality == after.quality && before.mode == after.mode;
}

void Drop(Signal signal, Sample& sample) {
  sample.present = static_cast<SignalMask>(sample.present & ~MaskOf(signal));
  sample.values[Index(signal)] = 0.0;
  sample.quality[Index(signal)] = SignalQuality::kBad;
}

struct TimedReading {
  double t_s;
  double value;
  SignalQuality quality;
};

// Reads the rows of a whole table and aligns them to a time grid.
class TableReader {
 public:
  TableReader(const TextLines& lines, const CsvOptions& options)
      : lines_(lines), reader_(Settled(lines_, options)) {}

  CsvTable Read();

 private:
  static CsvOptions Settled(const TextLines& lines, CsvOptions options) {
    options.map = FindLayout(lines, std::move(options.map), false).map;
    options.source = lines.places();
    return options;
  }
  void TakeRows();
  bool Joined(const CsvRow& row);
  void CheckCount() const;
  void OrderTags();
  void CheckOrder() const;
  void FindPeriod();
  bool IsSteady() const;
  void PutOnGrid();
  std::array<std::vector<TimedReading>, kSignalCount> Readings() const;
  void NoteResampling(const std::array<std::size_t, kSignalCount>& filled,
                      std::size_t samples);
  void CheckResampled(std::size_t samples) const;
  void Resample();
  void NoteForm();
  void DropImpossible(const ColumnMapping& mapping);
  void DropZeros();
  void CheckReadings();
  void CheckValues();
  void CheckPair(Signal signal);
  void CheckMotion();
  void NoteSplitRange();
  void MarkRepeats();
  void Cut();
  [[noreturn]] void RefuseAt(std::int64_t line,
                             const std::string& reason) const {
    throw DataError(options().source.At(static_cast<std::size_t>(line)) + ": " +
                    reason);
  }
  [[noreturn]] void RefuseStep(std::size_t k) const;
  // Offset of the rows from a grid that begins at the first one [s].
  double Phase() const;
  const CsvOptions& options() const { return reader_.options(); }
  bool MayHaveGaps() const {
    return options().split_gaps || options().map.resampling;
  }

  const TextLines& lines_;
  CsvReader reader_;
  std::deque<CsvRow> rows_;  // Unlike a vector, never in memory twice.
  // For a long table: where the row of an instant is.
  std::unordered_map<std::int64_t, std::size_t> row_at_;
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
  table_.notes.insert(table_.notes.begin(), reader_.notes().begin(),
                      reader_.notes().end());
  NoteForm();
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
    OrderTags();
  }
  CheckOrder();
  // Where values come by exception, the row before may be minutes older.
  if (!options().map.resampling && !options().map.long_table) {
    DropZeros();
  }
  if (options().check_values) {
    CheckValues();
  }
  CheckReadings();
  FindPeriod();
  if (options().check_values) {
    CheckMotion();
  }
  table_.start_ns = table_.dated ? rows_.front().labelled.sample.stamp_ns
                                 : options().start_ns;
  if (options().map.resampling) {
    Resample();
  } else if (!IsSteady()) {
    PutOnGrid();
  }
  MarkRepeats();
  Cut();
  for (const std::string& note : table_.notes) {
    if (options().log) {
      options().log(LogLevel::kInfo,
                    EventLine("csv_note", {{"source", options().source.name},
                                           {"note", note}}));
    }
  }
  return std::move(table_);
}

void TableReader::TakeRows() {
  std::size_t repeated = 0;
  ForEachRow(lines_, reader_, [&](CsvRow&& row) {
    const bool is_long = options().map.long_table.has_value();
    if (!is_long && !rows_.empty() &&
        rows_.back().labelled.sample.stamp_ns == row.labelled.sample.stamp_ns &&
        (options().skip_repeats || Repeats(rows_.back(), row))) {
      ++repeated;
    } else if (!is_long || !Joined(row)) {
      CheckCount();
      rows_.push_back(std::move(row));
    }
  });
  row_at_.clear();
  reader_.Finish();
  if (repeated > 0) {
    table_.notes.push_back(std::to_string(repeated) +
                           " rows have the time of the row before them and are "
                           "left out");
  }
}

// Notes findings about the form that are not usual.
void TableReader::NoteForm() {
  const ColumnMap& map = options().map;
  auto note = [this](const std::string& text) { table_.notes.push_back(text); };
  if (map.decimal == ',') {
    note("decimal sign: comma (found)");
  }
  if (map.thousands != '\0') {
    note("thousands grouped by " + Quoted({&map.thousands, 1}));
  }
  if (map.newest_first) {
    note("newest row first: read from the end");
  }
  if (map.long_table && !map.long_table->quality.empty()) {
    note("quality: column " + map.long_table->quality);
  }
  for (const auto& [column, quality] : map.quality_of) {
    note("quality of " + column + ": column " + quality);
  }
  if (const std::size_t rows = reader_.markers(); rows > 0) {
    note(std::to_string(rows) + " rows of markers or sums left out");
  }
}

// True if the row of a long table went into an earlier one of that instant; the
// table may be sorted by tag.
bool TableReader::Joined(const CsvRow& row) {
  const Sample& part = row.labelled.sample;
  const auto [at, is_new] = row_at_.try_emplace(part.stamp_ns, rows_.size());
  if (is_new) {
    return false;
  }
  Sample& whole = rows_[at->second].labelled.sample;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if (!part.Has(signal)) {
      continue;
    }
    if (whole.Has(signal) && options().skip_repeats) {
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
  return true;
}

void TableReader::CheckCount() const {
  if (lines_.packed() && rows_.size() >= options().max_packed_rows) {
    throw DataError(options().source.name + ": has more than " +
                    std::to_string(options().max_packed_rows) +
                    " rows, which a gzip may not have; try to unpack it with "
                    "gunzip first, or to cut it into parts");
  }
}

void TableReader::OrderTags() {
  std::ranges::sort(rows_, {}, [](const CsvRow& row) {
    return row.labelled.sample.stamp_ns;
  });
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
      if (table_.dated && std::ranges::all_of(rows_, [](const CsvRow& row) {
            return row.labelled.sample.stamp_ns % 60'000'000'000 == 0;
          })) {
        RefuseAt(rows_[k].line,
                 "several rows have one time, and all times are whole minutes: "
                 "the seconds are missing; try to export times with seconds (a "
                 "spreadsheet hides them unless the cells show hh:mm:ss)");
      }
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
    throw DataError(options().source.name +
                    ": one row does not tell the sample period; try --period");
  }
  std::vector<double> times_s;
  for (const CsvRow& row : rows_) {
    times_s.push_back(row.t_s);
  }
  period_s_ = MedianStep(times_s);
  if (IsSteady()) {
    return;
  }
  // Steady tables keep their exact step, however odd. Only steps with jitter
  // are taken for a blurred round period.
  period_s_ = UsualPeriod(period_s_);
}

// True if every step is one period, or a gap where gaps are allowed.
bool TableReader::IsSteady() const {
  for (std::size_t k = 1; k < rows_.size(); ++k) {
    const double off = rows_[k].t_s - rows_[k - 1].t_s - period_s_;
    // Half a period too much, or more, is a gap. Anything less is jitter, which
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
  return Median(std::move(off));
}

void TableReader::PutOnGrid() {
  const double begin_s = rows_.front().t_s + Phase();
  std::int64_t last = 0;
  double largest = 0.0;
  // Applied at the end, so that RefuseStep() shows the times of the file.
  std::vector<double> placed_s;
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
    placed_s.push_back(grid_s);
  }
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const double moved_s = placed_s[k] - rows_[k].t_s;
    rows_[k].t_s = placed_s[k];
    rows_[k].labelled.sample.stamp_ns += std::llround(moved_s * 1e9);
    largest = std::max(largest, std::abs(moved_s));
  }
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

void TableReader::CheckResampled(std::size_t samples) const {
  if (lines_.packed() && samples >= options().max_packed_rows) {
    throw DataError(options().source.name + ": --resample " +
                    NumberText(period_s_) + "s: more than " +
                    std::to_string(options().max_packed_rows) +
                    " samples, which a gzip may not have; try a longer "
                    "period, or to unpack it with gunzip first");
  }
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
  std::deque<CsvRow> grid;
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
    if (!sample.Has(Signal::kCv) || (sample.present & kAnswers) == 0) {
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
    CheckResampled(grid.size());
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      filled[i] += is_filled[i] ? 1U : 0U;
    }
    grid.push_back(std::move(made));
  }
  if (grid.empty()) {
    throw DataError(options().source.name +
                    ": no instant has CV and one of X, F; try a longer age, "
                    "--resample " +
                    NumberText(period_s_) + "s:hold:10min");
  }
  NoteResampling(filled, grid.size());
  rows_ = std::move(grid);
}

// Numbers of a state ("246" for a failed transmitter) among readings.
void TableReader::DropImpossible(const ColumnMapping& m) {
  std::map<double, std::size_t> cells;
  std::size_t count = 0;
  for (CsvRow& row : rows_) {
    Sample& sample = row.labelled.sample;
    if (sample.Has(m.signal) && !IsPlausible(sample, m.signal)) {
      const double value = sample[m.signal];
      ++cells[((m.sense == Sense::kOpening ? 100.0 - value : value) -
               m.offset) /
              m.scale];
      ++count;
      Drop(m.signal, sample);
    }
  }
  std::vector<std::string> usual;
  for (const auto& [cell, times] : cells) {
    if (usual.size() < 5) {
      usual.push_back(NumberText(std::round(cell * 1e6) / 1e6));
    }
  }
  table_.notes.push_back(
      std::string(SignalName(m.signal)) + " = " + m.column + ": " +
      std::to_string(count) + " cells beyond the range of the signal (" +
      Listed(usual) + (cells.size() > usual.size() ? ",..." : "") +
      ") taken as no reading");
}

// A valve that is really shut comes there and back through other readings.
void TableReader::DropZeros() {
  const auto& columns = options().map.columns;
  std::size_t count = 0;
  std::size_t begin = 0;
  for (std::size_t k = 0; k <= rows_.size(); ++k) {
    if (k < rows_.size() && IsAllZero(rows_[k].labelled.sample, columns)) {
      continue;
    }
    if (begin > 0 && begin < k && k < rows_.size() &&
        IsOpen(rows_[begin - 1].labelled.sample) &&
        IsOpen(rows_[k].labelled.sample)) {
      count += k - begin;
      for (std::size_t i = begin; i < k; ++i) {
        for (std::size_t s = 0; s < kSignalCount; ++s) {
          Drop(static_cast<Signal>(s), rows_[i].labelled.sample);
        }
      }
    }
    begin = k + 1;
  }
  if (count > 0) {
    table_.notes.push_back(
        std::to_string(count) + " of " + std::to_string(rows_.size()) +
        " rows are 0 in all columns between open ones, taken as no reading");
  }
}

// A signal is there if it has readings: a mere header, or a column that is bad
// throughout, gives nothing to diagnose.
void TableReader::CheckReadings() {
  std::array<std::size_t, kSignalCount> readings{};
  std::size_t usable = 0;
  for (const CsvRow& row : rows_) {
    const Sample& sample = row.labelled.sample;
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      readings[i] += sample.Has(static_cast<Signal>(i)) ? 1U : 0U;
    }
    usable +=
        sample.Has(Signal::kCv) && (sample.present & kAnswers) != 0 ? 1U : 0U;
  }
  const ColumnMap& map = options().map;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    const bool needed =
        ((options().required | MaskOf(Signal::kCv)) & MaskOf(signal)) != 0 &&
        (table_.header.signals & MaskOf(signal)) != 0;
    if (needed && readings[i] == 0) {
      throw DataError(
          options().source.name + ": no reading of " +
          std::string(SignalName(signal)) + " in " +
          std::to_string(rows_.size()) +
          " rows: its cells are empty, words for no reading, or of bad quality"
          "; try good under [quality] of --map, another column, or --signals "
          "without it");
    }
    if (const std::size_t beyond = reader_.beyond(signal); beyond > 0) {
      table_.notes.push_back(
          std::string(SignalName(signal)) + ": " + std::to_string(beyond) +
          " cells beyond `raw` (a broken wire?) taken as no reading");
    }
  }
  if (usable < rows_.size() && !map.resampling && !map.long_table) {
    table_.notes.push_back(std::to_string(usable) + " of " +
                           std::to_string(rows_.size()) +
                           " rows have CV and X or F");
  }
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
      if (!IsPlausible(sample, signal)) {
        first = first == nullptr ? &row : first;
        ++beyond;
      }
    }
    const std::string name(SignalName(signal));
    const auto mapping = std::ranges::find(options().map.columns, signal,
                                           &ColumnMapping::signal);
    const bool mapped = mapping != options().map.columns.end();
    // A mapped signal is refused, because the map states the conversion; others
    // are only noted, and left to the diagnosis, which refuses such samples.
    if (2 * beyond > count) {
      const std::string what =
          name + " is " + NumberText(first->labelled.sample[signal]) +
          " after conversion, and beyond " + NumberText(range.minimum) + ".." +
          NumberText(range.maximum) + " " + std::string(SignalUnit(signal)) +
          " in " + PercentText(beyond, count) +
          " of the rows; try unit, scale "
          "and span under [signal." +
          name + "] of --map";
      if (mapped) {
        RefuseAt(first->line, what);
      }
      table_.notes.push_back(what);
    } else if (mapped && beyond > 0) {
      DropImpossible(*mapping);
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
  LocalSense sense;
  std::size_t count = 0;
  std::size_t against = 0;
  for (const CsvRow& row : rows_) {
    const Sample& s = row.labelled.sample;
    if (s.Has(Signal::kX) && s.Has(Signal::kF)) {
      sense.Add(s[Signal::kX], s[Signal::kF]);
    }
    if (s.Has(Signal::kP1) && s.Has(Signal::kP2)) {
      ++count;
      against += s[Signal::kP2] > s[Signal::kP1] ? 1U : 0U;
    }
  }
  if (signal == Signal::kX && rows_.size() > 20 && sense.Value() > 0.5) {
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

// Notes the kind of valve and record, if the models are for another one.
void TableReader::CheckMotion() {
  constexpr std::size_t kEnough = 60;
  const SignalMask signals = table_.header.signals;
  const auto note = [this](std::string text) {
    table_.notes.push_back(std::move(text));
  };
  std::size_t n = 0;
  std::size_t shut = 0;
  std::size_t open = 0;
  std::size_t both = 0;
  std::size_t same = 0;
  std::size_t moves = 0;
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    const Sample& s = rows_[k].labelled.sample;
    if (!s.Has(Signal::kCv)) {
      continue;
    }
    ++n;
    const double cv = s[Signal::kCv];
    shut += cv > 98.0 ? 1U : 0U;
    open += cv < 2.0 ? 1U : 0U;
    both += s.Has(Signal::kX) ? 1U : 0U;
    same +=
        s.Has(Signal::kX) && std::abs(s[Signal::kX] - cv) < 5.1e-3 ? 1U : 0U;
    moves += k > 0 && rows_[k - 1].labelled.sample.Has(Signal::kCv) &&
                     rows_[k - 1].labelled.sample[Signal::kCv] != cv
                 ? 1U
                 : 0U;
  }
  const std::size_t ends = shut + open;
  if (n >= kEnough && 50 * ends >= 49 * n && 50 * std::min(shut, open) >= n) {
    note("an open/shut valve: CV is 0 or 100 % in " + PercentText(ends, n) +
         " of the rows. The models are for control valves, and onboarding "
         "will not fit it; if CV is a limit switch, map the command of the "
         "positioner as [signal.CV]");
  }
  if (both >= kEnough && 100 * same >= 99 * both && 10 * moves > n) {
    note("X is a copy of CV in " + PercentText(same, both) +
         " of the rows: it was not measured, and no fault shows in it. Map the "
         "position transmitter as [signal.X], or leave [signal.X] out");
  }
  const bool of_valve =
      (signals & (MaskOf(Signal::kX) | MaskOf(Signal::kF))) != 0;
  if (!of_valve) {
    note(
        "no position (X) and no flow (F): PV is the loop's, which is audited, "
        "and shows no fault of the valve by name");
  }
  if (of_valve && (signals & MaskOf(Signal::kX)) == 0) {
    note(
        "no position (X): CV and F show that something is wrong, not whether "
        "it is the rod, the trim or the flow transmitter. Map the position "
        "transmitter as [signal.X] if there is one");
  }
  if (of_valve && (signals & MaskOf(Signal::kF)) == 0) {
    note(
        "no flow (F): CV and X show what the rod does, not what the trim does "
        "(blocked, worn, leaking). Map the flow as [signal.F] if there is one");
  }
  if (period_s_ >= 5.0 && !options().map.resampling) {
    note(
        "a slow record: one row in " + NumberText(period_s_) +
        " s. Up to 10 s --resample 1s:linear fills in; of a slower record only "
        "what lasts is judged, not how the rod moves in between");
  }
  NoteSplitRange();
}

// In % of opening x = a + b u of the command u, where the rod is not at an end:
// b is 2 if the valve has half of a range to itself. The rod lags, so the
// strongest of four delays counts.
void TableReader::NoteSplitRange() {
  double strongest = 0.0;
  double slope = 1.0;
  double begin = 0.0;
  for (std::size_t lag = 0; lag < 4; ++lag) {
    CorrelationSums sums;
    for (std::size_t k = lag; k < rows_.size(); ++k) {
      const Sample& now = rows_[k].labelled.sample;
      const Sample& then = rows_[k - lag].labelled.sample;
      if (now.Has(Signal::kX) && then.Has(Signal::kCv) &&
          now[Signal::kX] > 5.0 && now[Signal::kX] < 95.0) {
        sums.Add(100.0 - then[Signal::kCv], 100.0 - now[Signal::kX]);
      }
    }
    const double r = sums.Correlation();
    if (sums.n >= 60.0 && r > std::max(strongest, 0.8)) {
      strongest = r;
      // Divided by r, because the lag flattens the line (total least squares of
      // equal errors would do the same).
      slope = std::sqrt((sums.n * sums.yy - sums.y * sums.y) /
                        (sums.n * sums.xx - sums.x * sums.x));
      begin = sums.x / sums.n - sums.y / sums.n / slope;
    }
  }
  if (slope > 1.5 && slope < 3.0) {
    const bool upper = begin > 25.0;
    table_.split_range = upper ? std::pair(50.0, 100.0) : std::pair(0.0, 50.0);
    table_.notes.push_back(
        "X moves " + NumberText(std::round(10.0 * slope) / 10.0) +
        " times as far as CV: one of two valves on a split range? raw = " +
        (upper ? "[50, 100]" : "[0, 50]") +
        " under [signal.CV] of --map says so");
  }
}

void TableReader::MarkRepeats() {
  ReadEvery every = MarkHeld(
      period_s_, rows_.size(),
      [&](std::size_t k) -> Sample& { return rows_[k].labelled.sample; });
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    const int* samples = EveryOf(every, signal);
    if (samples != nullptr && *samples > ReadEvery::kNoRepeats) {
      const std::string when =
          *samples == ReadEvery::kOnChange
              ? "when it changes"
              : "every " + NumberText(period_s_ * *samples) + " s";
      table_.notes.push_back(std::string(SignalName(signal)) + " is new " +
                             when +
                             " and held between: only new readings count");
    }
  }
}

void TableReader::Cut() {
  std::size_t gaps = 0;
  double missing_s = 0.0;
  double longest_s = 0.0;
  std::vector<std::size_t> lengths;
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
      lengths.push_back(0);
    }
    ++lengths.back();
  }
  // Rows leave as samples come, or there would be two of each for a while.
  for (const std::size_t length : lengths) {
    SampleSeries& run =
        table_.runs.emplace_back(EmptyRun(table_.header, period_s_));
    run.samples.reserve(options().take ? 0 : length);
    for (std::size_t k = 0; k < length; ++k) {
      if (options().take) {
        options().take(rows_.front().labelled);
      } else {
        run.samples.push_back(rows_.front().labelled);
      }
      rows_.pop_front();
      if (rows_.size() % 65536 == 0) {
        malloc_trim(0);
      }
    }
  }
  if (gaps > 0) {
    table_.notes.push_back(std::to_string(gaps) + " gaps, " +
                           NumberText(std::round(missing_s)) +
                           " s without samples, the longest " +
                           NumberText(std::round(longest_s)) + " s");
  }
}

}  // namespace

CsvTable ReadCsv(const TextLines& lines, const CsvOptions& options) {
  return TableReader(lines, options).Read();
}

CsvTable ReadCsv(std::string_view text, const CsvOptions& options) {
  return ReadCsv(TextLines(text, options.source), options);
}

CsvTable ReadCsvFile(const std::filesystem::path& path,
                     const CsvOptions& options) {
  return ReadCsv(TextLines::OfFile(path), options);
}

}  // namespace fdi::importer
