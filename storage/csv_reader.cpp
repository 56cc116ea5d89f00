#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/csv.h"
#include "storage/csv_cells.h"
#include "storage/csv_columns.h"

namespace fdi::storage {
namespace {

/// Steps in time may differ from the period by so much of it.
constexpr double kStepTolerance = 0.01;
/// Beyond it, nanoseconds since `start_ns` would not fit (100 years).
constexpr double kMaxSeconds = 3.2e9;

std::string Quoted(std::string_view text) {
  return '"' + std::string(text.substr(0, 60)) + '"';
}

std::string Seconds(double value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
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
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (line_ == 1 && line.starts_with(kByteOrderMark)) {
    line.remove_prefix(kByteOrderMark.size());
  }
  if (TrimCell(line).empty()) {
    return std::nullopt;
  }
  SplitCells(line, cells_);
  if (names_.empty()) {
    TakeHeader();
    return std::nullopt;
  }
  if (cells_.size() != names_.size()) {
    Refuse(std::to_string(cells_.size()) + " cells, the header has " +
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
    double value = Number(c.column);
    if (c.scale != 1.0 || c.offset != 0.0) {
      value = c.offset + c.scale * value;
    }
    sample.Set(c.signal, c.sense == Sense::kOpening ? 100.0 - value : value);
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
  if (names_.empty()) {
    throw DataError(options_.source + ": is empty: no header, no rows");
  }
  if (rows_ == 0) {
    throw DataError(options_.source + ": has a header but no rows");
  }
}

void CsvReader::TakeHeader() {
  names_.assign(cells_.begin(), cells_.end());
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

double CsvReader::Number(std::size_t column) const {
  const std::string_view cell = cells_[column];
  const char* first = cell.data();
  const char* last = first + cell.size();
  double value = 0.0;
  if (first != last && *first == '+') {
    ++first;
  }
  const auto [end, error] = std::from_chars(first, last, value);
  // Out of range is also what underflows; from_chars leaves no value then.
  if (error != std::errc() || end != last || !std::isfinite(value)) {
    Refuse("column " + Quoted(names_[column]) + ": " + Quoted(cell) +
           " is not a finite number");
  }
  return value;
}

ValveMode CsvReader::Mode() const {
  const std::string_view cell = cells_[*mode_column_];
  const std::optional<ValveMode> mode = ParseValveMode(cell);
  if (!mode) {
    Refuse("column " + Quoted(names_[*mode_column_]) + ": " + Quoted(cell) +
           " is none of " + std::string(kValveModeNames));
  }
  return *mode;
}

FaultTruth CsvReader::Truth() const {
  const double strength = Number(*strength_column_);
  const std::string_view cell = cells_[*fault_column_];
  const std::string name = "column " + Quoted(names_[*fault_column_]) + ": ";
  if (std::abs(strength) > 1.0) {
    Refuse("column " + Quoted(names_[*strength_column_]) + ": " +
           Quoted(cells_[*strength_column_]) + " is not in [-1, 1]");
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
    return {};
  }
  if (fault == 0) {
    Refuse(name + "a strength other than 0 needs a fault");
  }
  return {fault, strength};
}

bool CsvReader::CheckTime(double t_s) {
  if (std::abs(t_s) > kMaxSeconds) {
    Refuse("time " + Seconds(t_s) + " s is beyond 100 years");
  }
  const double step = t_s - std::exchange(last_t_s_, t_s);
  if (rows_ == 0) {
    return false;
  }
  if (!(step > 0.0)) {
    Refuse("time goes back or stands still: from " + Seconds(t_s - step) +
           " s to " + Seconds(t_s) + " s");
  }
  if (period_s_ == 0.0) {
    period_s_ = step;
  }
  if (std::abs(step - period_s_) <= kStepTolerance * period_s_) {
    return false;
  }
  if (options_.split_gaps && step > period_s_) {
    return true;
  }
  Refuse("time jumps by " + Seconds(step) + " s to " + Seconds(t_s) +
         " s, the sample period is " + Seconds(period_s_) + " s" +
         (step > period_s_ ? " (--split-gaps begins a new run at a gap)" : ""));
}

}  // namespace fdi::storage
