#include "monitor/bus/watch_table.h"

#include <algorithm>
#include <sstream>
#include <tuple>
#include <utility>
#include <vector>

#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "report/terminal.h"

namespace fdi::monitor {
namespace {

using report::Json;
using report::Tone;

// A monitor sends its status each second, and counts as dead after 5 s.
constexpr std::chrono::seconds kMonitorSilence{5};
std::int64_t NsOf(const Json& record, const char* key) {
  return ParseTime(record[key].get<std::string>(), true);
}

// Smaller is worse: named alarm, other alarm, not known, not judged, normal.
int Rank(const Json& row) {
  return row["fault"].is_string()          ? 0
         : row["certainty"].is_string()    ? 1
         : row["state"] == "NOT_CONFIRMED" ? 2
         : row["state"] != "NORMAL"        ? 3
                                           : 4;
}

// "f6 or f18"
std::string FaultText(const Json& row) {
  if (row["fault"].is_null()) {
    return "-";
  }
  auto text = row["fault"].get<std::string>();
  for (const Json& other : row["look_alikes"]) {
    text += " or " + other.get<std::string>();
  }
  return text;
}

Tone ToneOf(const Json& row) {
  return Rank(row) < 2              ? Tone::kAlarm
         : row["state"] != "NORMAL" ? Tone::kQuiet
                                    : Tone::kPlain;
}

}  // namespace

void WatchTable::Add(const Json& record, Clock::time_point now) {
  const auto topic = record["topic"].get<std::string>();
  if (topic == "MonitorStatus") {
    const auto text = record["text"].get<std::string>();
    monitors_[record["monitor"]] = {
        record["health"].get<std::string>() + (text.empty() ? "" : ": " + text),
        now};
  } else if (topic == "ValveState") {
    states_[record["valve_id"]] = record;
  }
}

bool WatchTable::IsHeard(const Json& monitor, Clock::time_point now) const {
  const auto found = monitors_.find(monitor.get<std::string>());
  return found != monitors_.end() && now - found->second.at <= kMonitorSilence;
}

Json WatchTable::RowOf(const Json& state, Clock::time_point now) const {
  Json row = state;
  row.erase("topic");
  row["name"] = row["fault"].is_null()
                    ? Json()
                    : Json(texts_
                               .Words(row["fault"].get<std::string>(),
                                      row["strength"].is_null()
                                          ? 0.0
                                          : row["strength"].get<double>())
                               .name);
  if (row["unconfirmed_utc"].is_null() && !IsHeard(row["monitor"], now)) {
    row["state"] = "NOT_CONFIRMED";
    row["unconfirmed_utc"] = row["as_of_utc"];
  }
  return row;
}

std::string WatchTable::Health(Clock::time_point now) const {
  std::string text;
  for (const auto& [name, monitor] : monitors_) {
    if (now - monitor.at <= kMonitorSilence) {
      text += (text.empty() ? "" : ", ") + name + " " + monitor.text;
    }
  }
  return text;
}

report::Report WatchTable::Valves(std::int64_t now_ns,
                                  Clock::time_point now) const {
  std::vector<std::pair<std::tuple<int, std::string>, Json>> rows;
  for (const auto& [valve_id, state] : states_) {
    Json row = RowOf(state, now);
    rows.emplace_back(std::tuple(Rank(row), valve_id), std::move(row));
  }
  std::ranges::sort(rows, {}, [](const auto& row) { return row.first; });
  const std::string health = Health(now);
  report::Report report;
  report.document = {{"as_of_utc", FormatTime(now_ns, true)},
                     {"monitor", health.empty() ? Json() : Json(health)},
                     {"valves", Json::array()}};
  for (auto& [order, row] : rows) {
    report.document["valves"].push_back(std::move(row));
  }
  using Format = report::Format;
  const auto state = [utc = utc_](const Json& row) {
    const auto since = [&row, utc](const char* what, const char* key) {
      return what + FormatTime(NsOf(row, key), utc);
    };
    return !row["unconfirmed_utc"].is_null()
               ? since("not confirmed since ", "unconfirmed_utc")
           : row["state"] == "NOT_JUDGED" && !row["unjudged_utc"].is_null()
               ? since("not judged since ", "unjudged_utc")
               : row["state"].get<std::string>();
  };
  const auto quality = [](const Json& row) {
    return row[row["why"].is_null() ? "quality" : "why"].get<std::string>();
  };
  return report.Table(
      "valves",
      {{.heading = "valve", .key = "valve_id", .tone = ToneOf},
       {.heading = "state", .text = state, .tone = ToneOf},
       {.heading = "quality", .spare = 3, .text = quality},
       {.heading = "fault", .spare = 4, .text = FaultText, .tone = ToneOf},
       {.heading = "how sure", .key = "certainty", .tone = ToneOf},
       {.heading = "meaning", .key = "name", .least_width = 15},
       {"strength", "strength", Format::kPercent, 0, 2},
       {"since", "since_utc", Format::kTime, 0, 1}});
}

std::string WatchTable::Text(std::size_t lines, std::int64_t now_ns,
                             Clock::time_point now) const {
  // Lines other than rows: title, blank, heading, "too narrow", "more below",
  // and the one that the last newline leads to.
  constexpr std::size_t kOtherLines = 6;
  report::Report report = Valves(now_ns / kNsPerSecond * kNsPerSecond, now);
  auto& rows = report.document["valves"].get_ref<Json::array_t&>();
  const std::size_t all = rows.size();
  const Json& monitor = report.document["monitor"];
  std::ostringstream text;
  text << Printable(
              FormatTime(NsOf(report.document, "as_of_utc"), utc_) + "  " +
              std::to_string(all) + " valves, " +
              std::to_string(std::ranges::count_if(
                  rows, [](const Json& row) { return Rank(row) < 2; })) +
              " in alarm, " +
              std::to_string(std::ranges::count_if(rows,
                                                   [](const Json& row) {
                                                     return row["state"] ==
                                                            "NOT_CONFIRMED";
                                                   })) +
              " not confirmed  " +
              (monitor.is_null() ? "NO MONITOR IS HEARD"
                                 : "monitor " + monitor.get<std::string>()))
       << "\n\n";
  rows.resize(std::min(all, std::max(lines, kOtherLines + 1) - kOtherLines));
  report.PrintText(text, {report::StdoutStyle(), utc_});
  if (all > rows.size()) {
    text << all - rows.size() << " more below\n";
  }
  return text.str();
}

}  // namespace fdi::monitor
