#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/model/sample.h"
#include "import/csv.h"

namespace fdi::simulator {

struct JsonRow {
  Sample sample;              ///< stamp_ns from t_s; seq counts from 0.
  std::optional<double> t_s;  ///< Missing: stamped on arrival.
};

/// Reads samples as JSON lines, one object a line, with the names of the CSV
/// contract as keys:
///
///     {"t_s": 0, "CV_pct": 70.1, "X_pct": 71.0, "F_t_h": 12.5, "mode": "AUTO"}
///
/// A signal that is null or missing is not present in that sample; CV and one
/// of X, F are required. t_s must be in all lines or in none; a missing mode
/// means AUTO. Other keys are ignored.
class JsonLineReader {
 public:
  /// @param source name for error messages.
  /// @param split_gaps accept gaps in time.
  /// @param period_s 0: taken from the first step.
  JsonLineReader(std::string source, bool split_gaps, double period_s)
      : source_(std::move(source)), steps_(split_gaps, period_s) {}

  /// @returns nothing for a blank line.
  /// @throws DataError naming source, line, key and reason.
  std::optional<JsonRow> TakeLine(std::string_view line);

  /// Unknown keys of the first object.
  const std::vector<std::string>& ignored_keys() const { return ignored_keys_; }

 private:
  void Set(const std::string& key, double value, JsonRow& row);
  void CheckTime(std::optional<double> t_s);
  [[noreturn]] void Refuse(const std::string& reason) const;

  std::string source_;
  importer::StepCheck steps_;
  std::vector<std::string> ignored_keys_;
  std::optional<FlowUnit> flow_unit_;
  bool has_time_{false};
  std::int64_t line_{0};
  std::uint64_t rows_{0};
};

}  // namespace fdi::simulator
