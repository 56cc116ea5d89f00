#include "cli/csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <istream>
#include <limits>
#include <ostream>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"

namespace fdi::cli {
namespace {

/// Steps in time may differ from the period by this share of it.
constexpr double kStepTolerance = 0.01;
/// 100 years: later times do not fit in nanoseconds since `start_ns`.
constexpr double kMaxSeconds = 3.2e9;

std::string Quoted(std::string_view text) {
  return '"' + std::string(text.substr(0, 60)) + '"';
}

/// The shortest text that reads back as the same double.
std::string NumberText(double value) {
  std::array<char, 32> digits;
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return {digits.data(), end};
}

/// The names that `signal` may have in a header: "F_m3_h or F_t_h".
std::string ColumnNames(Signal signal) {
  std::string names;
  for (const SignalColumn& column : kSignalColumns) {
    if (column.signal == signal) {
      names += names.empty() ? "" : " or ";
      names += column.name;
    }
  }
  return names;
}

/// All lines of a stream; keeps them, as the period is known at the end only.
std::vector<std::string> Lines(std::istream& input, const std::string& source) {
  std::vector<std::string> lines;
  std::string line;
  while (std::getline(input, line)) {
    lines.push_back(std::move(line));
    line.clear();
  }
  if (input.bad()) {
    throw DataError(source + ": cannot be read: " + std::strerror(errno));
  }
  return lines;
}

/// The most usual step in time; 0 if there is none. Steps within 1 % of the
/// median count as one.
double UsualStep(const std::vector<std::string>& lines, CsvOptions options) {
  // A first pass with every step allowed. What is wrong with a row is left to
  // the second one, which knows more.
  options.split_gaps = true;
  options.period_s = std::numeric_limits<double>::min();
  CsvReader reader(options);
  std::vector<double> steps;
  std::optional<double> last_t_s;
  try {
    for (const std::string& line : lines) {
      if (const auto row = reader.TakeLine(line)) {
        if (last_t_s) {
          steps.push_back(row->t_s - *last_t_s);
        }
        last_t_s = row->t_s;
      }
    }
  } catch (const DataError&) {
  }
  if (steps.empty()) {
    return 0.0;
  }
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

SampleSeries EmptyRun(const CsvHeader& header, double period_s) {
  SampleSeries run;
  run.flow_unit = header.flow_unit;
  run.period_s = period_s;
  run.has_truth = header.has_truth;
  run.signals = header.signals;
  return run;
}

/// The columns of the contract that a run has.
struct Columns {
  std::vector<SignalColumn> signals;
  bool mode{false};
  bool truth{false};
};

Columns ColumnsOf(std::span<const LabelledSample> samples, FlowUnit flow_unit) {
  Columns columns;
  SignalMask occurring = 0;
  for (const LabelledSample& labelled : samples) {
    occurring = static_cast<SignalMask>(occurring | labelled.sample.present);
    columns.truth = columns.truth || labelled.truth;
    columns.mode = columns.mode || labelled.sample.mode != ValveMode::kAuto;
  }
  for (const SignalColumn& column : kSignalColumns) {
    const bool wrong_unit =
        column.signal == Signal::kF && column.flow_unit != flow_unit;
    if ((occurring & MaskOf(column.signal)) != 0 && !wrong_unit) {
      columns.signals.push_back(column);
    }
  }
  return columns;
}

std::vector<std::string> HeaderOf(const Columns& columns) {
  std::vector<std::string> cells{std::string(kTimeColumn)};
  for (const SignalColumn& column : columns.signals) {
    cells.emplace_back(column.name);
  }
  if (columns.mode) {
    cells.emplace_back(kModeColumn);
  }
  if (columns.truth) {
    cells.emplace_back(kFaultColumn);
    cells.emplace_back(kStrengthColumn);
  }
  return cells;
}

std::vector<std::string> RowOf(const LabelledSample& labelled,
                               const Columns& columns, std::int64_t start_ns) {
  const Sample& sample = labelled.sample;
  std::vector<std::string> cells{
      NumberText(static_cast<double>(sample.stamp_ns - start_ns) / 1e9)};
  for (const SignalColumn& column : columns.signals) {
    const bool there =
        sample.Has(column.signal) &&
        (column.signal != Signal::kF || column.flow_unit == sample.flow_unit);
    cells.push_back(there ? NumberText(sample[column.signal]) : "");
  }
  if (columns.mode) {
    cells.emplace_back(ValveModeName(sample.mode));
  }
  if (columns.truth) {
    const FaultTruth truth = labelled.truth.value_or(FaultTruth{});
    cells.push_back(FaultName(truth.fault));
    cells.push_back(NumberText(truth.strength));
  }
  return cells;
}

}  // namespace

CsvReader::CsvReader(CsvOptions options)
    : options_(std::move(options)), period_s_(options_.period_s) {
  Require(options_.period_s >= 0.0, "the sample period is not negative");
  for (const ColumnMapping& m : options_.map.columns) {
    if (m.signal == Signal::kF && !options_.map.flow_unit) {
      throw ConfigError("map: column " + Quoted(m.column) +
                        " is a flow and needs its unit (m3/h or t/h)");
    }
  }
}

void CsvReader::Refuse(const std::string& reason) const {
  throw DataError(options_.source + ":" + std::to_string(line_) + ": " +
                  reason);
}

std::optional<CsvRow> CsvReader::TakeLine(std::string_view line) {
  ++line_;
  if (!record_.TakeLine(line) || record_.blank()) {
    return std::nullopt;
  }
  if (names_.empty()) {
    TakeHeader();
    return std::nullopt;
  }
  if (record_.cells().size() != names_.size()) {
    Refuse(std::to_string(record_.cells().size()) + " cells, the header has " +
           std::to_string(names_.size()));
  }
  CsvRow row;
  row.t_s = Number(*time_column_) * options_.map.time_scale;
  row.after_gap = CheckTime(row.t_s);
  Sample& sample = row.labelled.sample;
  sample.stamp_ns = options_.start_ns + std::llround(row.t_s * 1e9);
  sample.seq = rows_++;
  sample.flow_unit = header_.flow_unit;
  for (const Conversion& c : conversions_) {
    std::optional<double> value = Reading(c.column);
    if (!value) {
      continue;
    }
    // Only if asked for: 0 + 1 * value would lose the sign of −0.
    if (c.scale != 1.0 || c.offset != 0.0) {
      value = c.offset + c.scale * *value;
    }
    sample.Set(c.signal, c.sense == Sense::kOpening ? 100.0 - *value : *value);
  }
  if (mode_column_) {
    sample.mode = Mode();
  }
  if (header_.has_truth) {
    row.labelled.truth = Truth();
  }
  return row;
}

void CsvReader::Finish() const {
  if (record_.open()) {
    Refuse("a quote is not closed before the end");
  }
  if (names_.empty()) {
    throw DataError(options_.source + ": is empty: no header, no rows");
  }
  if (rows_ == 0) {
    throw DataError(options_.source + ": has a header but no rows");
  }
}

void CsvReader::TakeHeader() {
  names_ = record_.cells();
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const std::string& name = names_[i];
    if (SameName(name, options_.map.time_column)) {
      if (time_column_) {
        Refuse("column " + Quoted(name) + " is there twice");
      }
      time_column_ = i;
    } else if (!AddMapped(i, name) && !AddByContract(i, name)) {
      header_.ignored_columns.push_back(name);
    }
  }
  header_.has_truth = fault_column_ || strength_column_;
  CheckHeader();
}

void CsvReader::AddSignal(const Conversion& conversion) {
  if ((header_.signals & MaskOf(conversion.signal)) != 0) {
    Refuse("column " + Quoted(names_[conversion.column]) + ": signal " +
           std::string(SignalName(conversion.signal)) + " is there twice");
  }
  header_.signals =
      static_cast<SignalMask>(header_.signals | MaskOf(conversion.signal));
  conversions_.push_back(conversion);
}

bool CsvReader::AddMapped(std::size_t column, std::string_view name) {
  for (const ColumnMapping& m : options_.map.columns) {
    if (m.column == name) {
      if (m.signal == Signal::kF) {
        header_.flow_unit = *options_.map.flow_unit;
      }
      AddSignal({column, m.signal, m.scale, m.offset, m.sense});
      return true;
    }
  }
  return false;
}

bool CsvReader::AddByContract(std::size_t column, std::string_view name) {
  if (SameName(name, kFaultColumn) || SameName(name, kFaultNumberColumn)) {
    if (fault_column_) {
      Refuse("column " + Quoted(name) + ": the fault is there twice");
    }
    fault_column_ = column;
    fault_by_number_ = SameName(name, kFaultNumberColumn);
    return true;
  }
  if (SameName(name, kStrengthColumn)) {
    if (strength_column_) {
      Refuse("column " + Quoted(name) + " is there twice");
    }
    strength_column_ = column;
    return true;
  }
  if (SameName(name, kModeColumn)) {
    if (mode_column_) {
      Refuse("column " + Quoted(name) + " is there twice");
    }
    mode_column_ = column;
    return true;
  }
  for (const SignalColumn& known : kSignalColumns) {
    if (SameName(name, known.name)) {
      if (known.signal == Signal::kF) {
        header_.flow_unit = known.flow_unit;
      }
      AddSignal({column, known.signal, 1.0, 0.0, Sense::kClosing});
      return true;
    }
  }
  return false;
}

void CsvReader::CheckHeader() const {
  std::string missing;
  const auto require = [&](bool there, std::string_view name) {
    if (!there) {
      missing += (missing.empty() ? "" : ", ") + std::string(name);
    }
  };
  // Who maps columns says which signals there are; nothing else is demanded.
  const unsigned listed = options_.map.columns.empty() ? options_.required : 0U;
  const auto required = static_cast<SignalMask>(listed | MaskOf(Signal::kCv));
  require(time_column_.has_value(), options_.map.time_column);
  for (const ColumnMapping& m : options_.map.columns) {
    require(std::find(names_.begin(), names_.end(), m.column) != names_.end(),
            m.column);
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((required & MaskOf(signal)) != 0) {
      require((header_.signals & MaskOf(signal)) != 0, ColumnNames(signal));
    }
  }
  require((header_.signals & (MaskOf(Signal::kX) | MaskOf(Signal::kF))) != 0,
          "one of X_pct, F_m3_h, F_t_h");
  require(fault_column_ || !strength_column_, "fault (or fault_no)");
  require(strength_column_ || !fault_column_, kStrengthColumn);
  if (!missing.empty()) {
    std::string found;
    for (const std::string& name : names_) {
      found += (found.empty() ? "" : ",") + name;
    }
    Refuse("missing column " + missing + "; the header is " + Quoted(found));
  }
}

std::optional<double> CsvReader::Reading(std::size_t column) const {
  const std::string& cell = record_.cells()[column];
  // Exports were once written with `nan`, and other tools still do.
  return cell.empty() || SameName(cell, "nan") ? std::nullopt
                                               : std::optional(Number(column));
}

double CsvReader::Number(std::size_t column) const {
  const std::string_view cell = record_.cells()[column];
  const auto value = ParseNumber(cell);
  if (!value) {
    Refuse("column " + Quoted(names_[column]) + ": " + Quoted(cell) +
           " is not a finite number");
  }
  return *value;
}

ValveMode CsvReader::Mode() const {
  const std::string_view cell = record_.cells()[*mode_column_];
  const std::optional<ValveMode> mode = ParseValveMode(cell);
  if (!mode) {
    Refuse("column " + Quoted(names_[*mode_column_]) + ": " + Quoted(cell) +
           " is none of " + std::string(kValveModeNames));
  }
  return *mode;
}

FaultTruth CsvReader::Truth() const {
  const double strength = Number(*strength_column_);
  const std::string_view cell = record_.cells()[*fault_column_];
  const std::string name = "column " + Quoted(names_[*fault_column_]) + ": ";
  if (std::abs(strength) > 1.0) {
    Refuse("column " + Quoted(names_[*strength_column_]) + ": " +
           Quoted(record_.cells()[*strength_column_]) + " is not in [-1, 1]");
  }
  int fault = 0;
  if (fault_by_number_) {
    const double number = Number(*fault_column_);
    if (number != std::floor(number) || number < 0.0 || number > kLastFault) {
      Refuse(name + Quoted(cell) + " is not in 0.." +
             std::to_string(kLastFault));
    }
    fault = static_cast<int>(number);
  } else if (!cell.empty() && !SameName(cell, "normal")) {
    const std::optional<int> parsed = ParseFault(cell);
    if (!parsed) {
      Refuse(name + Quoted(cell) + " is not a fault (" +
             std::string(kFaultNames) + ", normal)");
    }
    fault = *parsed;
  }
  if (strength == 0.0) {
    return {};  // Simulators name the fault before it begins.
  }
  if (fault == 0) {
    Refuse(name + "a strength other than 0 needs a fault");
  }
  return {fault, strength};
}

bool CsvReader::CheckTime(double t_s) {
  if (std::abs(t_s) > kMaxSeconds) {
    Refuse("time " + NumberText(t_s) + " s is beyond 100 years");
  }
  const double step = t_s - std::exchange(last_t_s_, t_s);
  if (rows_ == 0) {
    return false;
  }
  if (!(step > 0.0)) {
    Refuse("time goes back or stands still: from " + NumberText(t_s - step) +
           " s to " + NumberText(t_s) + " s");
  }
  if (period_s_ == 0.0) {
    period_s_ = step;
  }
  if (std::abs(step - period_s_) <= kStepTolerance * period_s_) {
    return false;
  }
  // A step that is too short is never a gap but a fault of the file.
  if (options_.split_gaps && step > period_s_) {
    return true;
  }
  Refuse("time jumps by " + NumberText(step) + " s to " + NumberText(t_s) +
         " s, the sample period is " + NumberText(period_s_) + " s" +
         (step > period_s_ ? " (--split-gaps begins a new run at a gap)" : ""));
}

CsvTable ReadCsv(std::istream& input, const CsvOptions& options) {
  const std::vector<std::string> lines = Lines(input, options.source);
  CsvOptions settled = options;
  if (settled.period_s == 0.0) {
    settled.period_s = UsualStep(lines, options);
  }
  CsvReader reader(settled);
  // A file is read twice, as text: the period is known after all of it.
  CsvTable table;
  for (const std::string& line : lines) {
    std::optional<CsvRow> row = reader.TakeLine(line);
    if (!row) {
      continue;
    }
    if (table.runs.empty() || row->after_gap) {
      table.runs.push_back(EmptyRun(reader.header(), settled.period_s));
    }
    table.runs.back().samples.push_back(row->labelled);
  }
  reader.Finish();
  if (settled.period_s == 0.0) {
    throw DataError(options.source +
                    ": one row does not tell the sample period");
  }
  table.header = reader.header();
  return table;
}

CsvTable ReadCsvFile(const std::filesystem::path& path, CsvOptions options) {
  options.source = path.string();
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    throw DataError(options.source + ": is a directory, not a file");
  }
  std::ifstream input(path);
  if (!input) {
    throw DataError(options.source +
                    ": cannot be opened: " + std::strerror(errno));
  }
  return ReadCsv(input, options);
}

void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns) {
  const Columns columns = ColumnsOf(samples, flow_unit);
  WriteCsvLine(output, HeaderOf(columns));
  for (const LabelledSample& labelled : samples) {
    WriteCsvLine(output, RowOf(labelled, columns, start_ns));
  }
  if (!output.flush()) {
    throw DataError(std::string("CSV cannot be written: ") +
                    std::strerror(errno));
  }
}

}  // namespace fdi::cli
