#include "programs/simulator/json_line_reader.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace fdi::simulator {
namespace {

using Json = nlohmann::json;

constexpr double kMaxSeconds = 3.2e9;  // Longer would overflow nanoseconds.

// "sp" only beside a "pv".
const importer::SignalColumn* FindColumn(std::string_view key, bool has_pv) {
  for (const importer::SignalColumn& column : importer::kSignalColumns) {
    if (SameName(column.name, key) && (has_pv || !NeedsPv(column))) {
      return &column;
    }
  }
  return nullptr;
}

bool IsTime(std::string_view key) {
  return SameName(key, importer::kTimeColumn);
}

bool IsTruth(std::string_view key) {
  return SameName(key, importer::kFaultColumn) ||
         SameName(key, importer::kFaultNumberColumn) ||
         SameName(key, importer::kStrengthColumn);
}

bool IsBlank(std::string_view line) {
  return line.find_first_not_of(" \t\r") == std::string_view::npos;
}

}  // namespace

void JsonLineReader::Refuse(const std::string& reason) const {
  throw DataError(source_ + ':' + std::to_string(line_) + ": " + reason);
}

std::optional<JsonRow> JsonLineReader::TakeLine(std::string_view line) {
  ++line_;
  if (IsBlank(line)) {
    return std::nullopt;
  }
  const Json object = Json::parse(line, nullptr, false);
  if (!object.is_object()) {
    Refuse("not a JSON object");
  }
  JsonRow row;
  const bool has_pv = std::ranges::any_of(object.items(), [](const auto& item) {
    return SameName(item.key(), SignalName(Signal::kPv));
  });
  for (const auto& [key, value] : object.items()) {
    if (SameName(key, importer::kModeColumn)) {
      const auto mode =
          ParseValveMode(value.is_string() ? value.get<std::string>() : "");
      if (!mode) {
        Refuse("key \"" + key + "\": " + value.dump().substr(0, 60) +
               " is none of " + std::string(kValveModeNames));
      }
      row.sample.mode = *mode;
    } else if (FindColumn(key, has_pv) == nullptr && !IsTime(key)) {
      if (rows_ == 0 && !IsTruth(key)) {
        ignored_keys_.push_back(key);
      }
    } else if (value.is_number() && std::isfinite(value.get<double>())) {
      Set(key, value.get<double>(), row);
    } else if (!value.is_null()) {
      Refuse("key \"" + key + "\": " + value.dump().substr(0, 60) +
             " is not a finite number");
    }
  }
  importer::DropLoneSetPoint(has_pv ? MaskOf(Signal::kPv) : SignalMask{0},
                             row.sample);
  if (!row.sample.Has(Signal::kCv)) {
    Refuse("missing key CV_pct");
  }
  if ((row.sample.present & importer::kAnswers) == 0) {
    Refuse("missing key: one of X_pct, F_m3_h, F_t_h, pv");
  }
  CheckTime(row.t_s);
  row.sample.flow_unit = flow_unit_.value_or(FlowUnit::kM3PerHour);
  row.sample.stamp_ns = std::llround(row.t_s.value_or(0.0) * 1e9);
  row.sample.seq = rows_++;
  return row;
}

// F_m3_h and F_t_h are one signal: the unit of the first line that has it
// holds.
void JsonLineReader::Set(const std::string& key, double value, JsonRow& row) {
  if (IsTime(key)) {
    row.t_s = value;
    return;
  }
  const importer::SignalColumn& column = *FindColumn(key, true);
  if (row.sample.Has(column.signal)) {
    Refuse("key \"" + key + "\": the signal is there twice");
  }
  if (column.signal == Signal::kF) {
    if (flow_unit_.value_or(column.flow_unit) != column.flow_unit) {
      Refuse("key \"" + key + "\": the flow was in " +
             std::string(FlowUnitName(*flow_unit_)) + " before");
    }
    flow_unit_ = column.flow_unit;
  }
  row.sample.Set(column.signal, value);
}

void JsonLineReader::CheckTime(std::optional<double> t_s) {
  if (t_s && std::abs(*t_s) > kMaxSeconds) {
    Refuse("t_s is beyond 100 years");
  }
  if (rows_ == 0) {
    has_time_ = t_s.has_value();
  }
  if (t_s.has_value() != has_time_) {
    Refuse("t_s must be in all lines or in none");
  }
  const std::string wrong = t_s ? steps_.Take(*t_s) : "";
  if (!wrong.empty()) {
    Refuse(wrong);
  }
}

}  // namespace fdi::simulator
