// The planner's tables as CSV, RFC 4180, made of their JSON.
#include <array>
#include <utility>

#include "monitor/planner/health_view.h"
#include "storage/cli/time_text.h"

namespace fdi::planner {
namespace {

using cli::Json;

constexpr std::int64_t kNsPerMs = 1'000'000;

constexpr std::array kWorkColumns{
    "rank",         "valve",          "score",        "severity", "discipline",
    "namur",        "fault",          "name",         "why",      "check",
    "strength",     "open",           "episodes",     "episode",  "confirmed",
    "detected_utc", "travel_strokes", "service_hours"};
constexpr std::array kHourColumns{
    "hour_utc", "epoch",  "model_hash", "seen_h",         "live_h",   "alarm_h",
    "open_h",   "shut_h", "d0",         "travel_strokes", "reversals"};
constexpr std::array kChannelColumns{"signal", "unit", "mean", "rms",
                                     "percent"};

std::string Quoted(const std::string& cell) {
  if (cell.find_first_of(",\"\r\n") == std::string::npos) {
    return cell;
  }
  std::string quoted = "\"";
  for (const char c : cell) {
    quoted += c;
    if (c == '"') {
      quoted += c;
    }
  }
  return quoted + "\"";
}

// `x_utc` stands for the key x_ms.
std::string CellOf(const Json& row, std::string_view column) {
  std::string key(column);
  const bool time = column.ends_with("_utc");
  if (time) {
    key.replace(key.size() - 3, 3, "ms");
  }
  const auto value = row.find(key);
  if (value == row.end() || value->is_null()) {
    return {};
  }
  if (time) {
    return cli::FormatTime(value->get<std::int64_t>() * kNsPerMs, true);
  }
  return value->is_string() ? Quoted(value->get<std::string>()) : value->dump();
}

template <typename Columns>
void WriteHeader(std::ostream& out, const Columns& columns,
                 const char*& separator) {
  for (const char* column : columns) {
    out << std::exchange(separator, ",") << column;
  }
}

template <typename Columns>
void WriteCells(std::ostream& out, const Json& row, const Columns& columns,
                const char*& separator) {
  for (const char* column : columns) {
    out << std::exchange(separator, ",") << CellOf(row, column);
  }
}

}  // namespace

void WriteWorkListCsv(std::ostream& out, std::span<const WorkRow> rows) {
  const char* separator = "";
  WriteHeader(out, kWorkColumns, separator);
  out << "\r\n";
  const Json list = WorkListJson(rows);
  for (const Json& row : list["rows"]) {
    separator = "";
    WriteCells(out, row, kWorkColumns, separator);
    out << "\r\n";
  }
}

void WriteHealthCsv(std::ostream& out, std::span<const HealthHour> hours) {
  const char* separator = "";
  WriteHeader(out, kHourColumns, separator);
  WriteHeader(out, kChannelColumns, separator);
  out << "\r\n";
  for (const HealthHour& hour : hours) {
    const Json row = HealthHoursJson({&hour, 1})["hours"][0];
    Json channels = row["channels"];
    if (channels.empty()) {
      channels.push_back(Json::object());
    }
    for (const Json& channel : channels) {
      separator = "";
      WriteCells(out, row, kHourColumns, separator);
      WriteCells(out, channel, kChannelColumns, separator);
      out << "\r\n";
    }
  }
}

}  // namespace fdi::planner
