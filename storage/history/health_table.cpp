#include "storage/history/health_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/model_set.h"
#include "storage/database/virtual_table.h"
#include "storage/history/health.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"

namespace fdi::storage::loadable {
namespace sql = history_sql;
namespace {

enum Column {
  kHealthValveId,
  kHourUtc,
  kModelHash,
  kEpoch,
  kValueName,
  kPart,
  kCvFrom,
  kSamples,
  kValue
};

// Rows of all hours have different ids: those of one hour have the lower bits.
constexpr int kValueBits = 10;
static_assert(3 * kMaxChannels * kCommandBins + kLastFinding +
                  static_cast<int>(loop::kFigureCount) + 16 <
              1 << kValueBits);

struct Value {
  std::string name;
  double value{0.0};
  std::optional<std::int64_t> samples{};
  std::string part{};  // Signal or fault.
  std::optional<int> cv_from{};
};

double Mean(std::int64_t sum, std::int64_t count, double quantum) {
  return static_cast<double>(sum) / static_cast<double>(count) * quantum;
}

void AddResiduals(const HealthHour& hour, std::vector<Value>& values) {
  for (std::size_t b = 0; b < hour.bins.size(); ++b) {
    for (std::size_t c = 0; c < hour.bins[b].size(); ++c) {
      const ResidualSums& sums = hour.bins[b][c];
      if (sums.samples == 0) {
        continue;
      }
      const std::string signal(SignalName(hour.channels[c].output));
      const double quantum = hour.channels[c].quantum();
      const int from = static_cast<int>(b) * 100 / kCommandBins;
      values.push_back({"residual", Mean(sums.residual, sums.samples, quantum),
                        sums.samples, signal, from});
      values.push_back(
          {"residual_rms",
           std::sqrt(Mean(sums.square, sums.samples, 1.0)) * quantum,
           sums.samples, signal, from});
      values.push_back({"reading", Mean(sums.output, sums.samples, quantum),
                        sums.samples, signal, from});
    }
  }
}

// The names are those of `fdi-store health --json`.
std::vector<Value> ValuesOf(const HealthHour& hour) {
  constexpr double kStroke = HealthHour::kTravel / HealthHour::kFullStroke;
  const loop::ValveCounts& counts = hour.counts;
  const auto number = [](std::int64_t n) { return static_cast<double>(n); };
  const auto hours = [&](std::int64_t ms) { return number(ms) / kMsPerHour; };
  std::vector<Value> values{{"seen_h", hours(hour.seen_ms)},
                            {"live_h", hours(hour.live_ms)},
                            {"alarm_h", hours(hour.alarm_ms)},
                            {"auto_h", hours(counts.auto_ms)},
                            {"open_h", hours(hour.open_ms)},
                            {"shut_h", hours(hour.shut_ms)},
                            {"travel_strokes", number(hour.travel) * kStroke},
                            {"path_strokes", number(counts.path) * kStroke},
                            {"reversals", number(hour.reversals)},
                            {"slip_jumps", number(counts.slips)},
                            {"turns", number(counts.turns)},
                            {"steps", number(counts.steps)}};
  if (hour.live_samples > 0) {
    values.push_back(
        {"d0", Mean(hour.normal_factor, hour.live_samples, HealthHour::kShare),
         hour.live_samples});
  }
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const auto figure = static_cast<loop::Figure>(i);
    if (const auto value = loop::FigureOf(figure, counts, hour.seen_ms)) {
      values.push_back({std::string(loop::FigureName(figure)), *value});
    }
  }
  AddResiduals(hour, values);
  for (const StrengthSums& sums : hour.strengths) {
    if (sums.samples > 0) {
      values.push_back({"strength",
                        Mean(sums.strength, sums.samples, HealthHour::kShare),
                        sums.samples, FaultName(sums.fault)});
    }
  }
  return values;
}

class HealthCursor : public sqlite3_vtab_cursor {
 public:
  static constexpr const char* kName = "health_hour_value";
  static constexpr const char* kTable =
      "CREATE TABLE health_hour_value (valve_id TEXT, hour_utc TEXT, "
      "model_hash TEXT, epoch INTEGER, name TEXT, part TEXT, "
      "cv_from INTEGER, samples INTEGER, value REAL)";

  explicit HealthCursor(sqlite3* database)
      : sqlite3_vtab_cursor{}, database_(database) {}

  static bool Narrows(int column, int op);
  void Filter(std::string_view plan, std::span<sqlite3_value*> values);
  void Next();
  bool AtEnd() const { return position_ >= values_.size(); }
  void Result(sqlite3_context* context, int column) const;
  // SQLite joins the rows of several conditions by these ids, and an hour has
  // no number of its own.
  std::int64_t RowId() const {
    const std::string key = hour_.valve_id + '/' + std::to_string(hour_.hour) +
                            '/' + std::to_string(hour_.model_hash) + '/' +
                            std::to_string(hour_.epoch);
    return static_cast<std::int64_t>(
        std::hash<std::string>{}(key) << kValueBits | position_);
  }

 private:
  sqlite3* database_;
  Rows rows_;
  HealthHour hour_;
  std::vector<Value> values_;
  std::size_t position_{0};
};

// A comparison with a valve or a time narrows the hours that are read.
bool HealthCursor::Narrows(int column, int op) {
  switch (op) {
    case SQLITE_INDEX_CONSTRAINT_EQ:
      return column == kHealthValveId || column == kHourUtc;
    case SQLITE_INDEX_CONSTRAINT_GLOB:
      return column == kHealthValveId;
    case SQLITE_INDEX_CONSTRAINT_GT:
    case SQLITE_INDEX_CONSTRAINT_GE:
    case SQLITE_INDEX_CONSTRAINT_LT:
    case SQLITE_INDEX_CONSTRAINT_LE:
      return column == kHourUtc;
    default:
      return false;
  }
}

void HealthCursor::Filter(std::string_view plan,
                          std::span<sqlite3_value*> values) {
  const std::string schema = FindDatabase(
      database_, kHistoryApplicationId,
      sql::kBaseline + static_cast<int>(sql::kMigrations.size()) - 1,
      "a history.db");
  Window window;
  std::string text =
      "SELECT valve_id, hour, model_hash, epoch, live_ms, bytes FROM " +
      schema + "health_hour WHERE hour BETWEEN ?1 AND ?2";
  std::vector<sqlite3_value*> valves;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int op = static_cast<unsigned char>(plan[2 * i + 1]);
    if (plan[2 * i] - 'a' == kHealthValveId) {
      valves.push_back(values[i]);
      text += std::string(" AND valve_id ") +
              (op == SQLITE_INDEX_CONSTRAINT_GLOB ? "GLOB ?" : "= ?") +
              std::to_string(valves.size() + 2);
    } else if (sqlite3_value_type(values[i]) == SQLITE_TEXT) {
      NarrowByUtc(op,
                  reinterpret_cast<const char*>(sqlite3_value_text(values[i])),
                  window);
    }
  }
  rows_ =
      Prepare(database_, text + " ORDER BY valve_id, hour, model_hash, epoch");
  // Hours beyond these are no time.
  sqlite3_bind_int64(
      rows_.get(), 1,
      std::max(window.from / kNsPerHour - 1, kEarliest / kNsPerHour));
  sqlite3_bind_int64(
      rows_.get(), 2,
      std::min(window.to / kNsPerHour + 1, kLatest / kNsPerHour));
  for (std::size_t i = 0; i < valves.size(); ++i) {
    sqlite3_bind_value(rows_.get(), static_cast<int>(i) + 3, valves[i]);
  }
  values_.clear();
  position_ = 0;
  Next();
}

void HealthCursor::Next() {
  if (++position_ < values_.size()) {
    return;
  }
  position_ = 0;
  values_.clear();
  // Each hour has values: how long it was seen.
  if (!Step(rows_.get())) {
    return;
  }
  hour_ = {};
  hour_.valve_id = Text(rows_.get(), 0);
  hour_.hour = sqlite3_column_int64(rows_.get(), 1);
  hour_.model_hash =
      static_cast<std::uint64_t>(sqlite3_column_int64(rows_.get(), 2));
  hour_.epoch =
      static_cast<std::uint32_t>(sqlite3_column_int64(rows_.get(), 3));
  hour_.live_ms = sqlite3_column_int64(rows_.get(), 4);
  const auto* bytes =
      static_cast<const std::byte*>(sqlite3_column_blob(rows_.get(), 5));
  UnpackHealth(
      {bytes, static_cast<std::size_t>(sqlite3_column_bytes(rows_.get(), 5))},
      hour_);
  values_ = ValuesOf(hour_);
}

void HealthCursor::Result(sqlite3_context* context, int column) const {
  const Value& value = values_[position_];
  switch (column) {
    case kHealthValveId:
      return ResultText(context, hour_.valve_id);
    case kHourUtc:
      // The view judged_hours has no milliseconds either.
      return ResultText(context,
                        UtcText(hour_.hour * kNsPerHour).substr(0, 19) + 'Z');
    case kModelHash: {
      std::array<char, 17> text{};
      std::snprintf(text.data(), text.size(), "%016llx",
                    static_cast<unsigned long long>(hour_.model_hash));
      return ResultText(context, text.data());
    }
    case kEpoch:
      return sqlite3_result_int64(context, hour_.epoch);
    case kValueName:
      return ResultText(context, value.name);
    case kPart:
      return value.part.empty() ? sqlite3_result_null(context)
                                : ResultText(context, value.part);
    case kCvFrom:
      return value.cv_from ? sqlite3_result_int64(context, *value.cv_from)
                           : sqlite3_result_null(context);
    case kSamples:
      return value.samples ? sqlite3_result_int64(context, *value.samples)
                           : sqlite3_result_null(context);
    default:
      return sqlite3_result_double(context, value.value);
  }
}

}  // namespace
}  // namespace fdi::storage::loadable

namespace fdi::storage {

sqlite3_module HealthTable() {
  return loadable::VirtualTable<loadable::HealthCursor>::Module();
}

}  // namespace fdi::storage
