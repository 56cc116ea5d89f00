#include "monitor/bus/watch_table.h"

#include <algorithm>
#include <limits>
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
// A valve counts as silent after three periods, as in the monitor. Vectors of a
// fast one may be late by the load of the machines.
constexpr double kSilentPeriods = 3.0;
constexpr double kLeastSilenceS = 10.0;

std::int64_t NsOf(const Json& record, const char* key) {
  return ParseTime(record[key].get<std::string>(), true);
}

// Reasons for which an alarm ends without anybody knowing whether the fault is
// gone: its data ended, or the monitor did.
bool EndedWithItsData(const Json& event) {
  const Json& reason = event["reason"];
  return event["transition"] == "CLOSED" &&
         (reason == "stream_ended" || reason == "stale_timeout" ||
          reason == "unknown");
}

bool IsOpen(const Json& event) {
  return !event.is_null() && event["transition"] != "CLOSED";
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
  } else if (topic == "ModelSetInfo") {
    periods_s_[record["model_hash"]] = record["sample_period_s"];
  } else if (topic == "FaultEvent") {
    Valve& valve = valves_[record["valve_id"]];
    valve.event = record;
    if (EndedWithItsData(record)) {
      valve.goes_on = false;
      valve.ended_ns = NsOf(record, "stamp_utc");
    }
  } else if (topic == "DecisionVector") {
    Valve& valve = valves_[record["valve_id"]];
    const std::int64_t stamp_ns = NsOf(record, "stamp_utc");
    // Another source may have other times, as a replay has.
    valve.goes_on =
        !valve.vector.is_null() &&
        (valve.goes_on || stamp_ns > std::max(valve.stamp_ns, valve.ended_ns) ||
         record["source_id"] != valve.vector["source_id"]);
    valve.stamp_ns = stamp_ns;
    valve.vector = record;
    valve.at = now;
  }
}

void WatchTable::Remove(const std::string& valve_id) {
  const auto found = valves_.find(valve_id);
  if (found == valves_.end()) {
    return;
  }
  if (InAlarm(found->second)) {
    found->second.vector = Json();
    found->second.goes_on = false;
  } else {
    valves_.erase(found);
  }
}

// An alarm that ended with its data lasts until the valve goes on.
bool WatchTable::InAlarm(const Valve& valve) {
  return IsOpen(valve.event) ||
         (!valve.event.is_null() && EndedWithItsData(valve.event) &&
          !valve.goes_on);
}

bool WatchTable::IsConfirmed(const Valve& valve, Clock::time_point now) const {
  if (!valve.goes_on) {
    return false;
  }
  const auto period = periods_s_.find(valve.vector["model_hash"]);
  const double patience_s =
      period == periods_s_.end()
          ? kLeastSilenceS
          : std::max(kLeastSilenceS, kSilentPeriods * period->second);
  return now - valve.at <= std::chrono::duration<double>(patience_s);
}

// Events know the name of an episode, the layers that a vector does not have,
// and episodes of the audit beside a model set that finds nothing. A vector may
// be ahead of its event.
Json WatchTable::RowOf(const std::string& valve_id, const Valve& valve,
                       Clock::time_point now) const {
  const bool known = !valve.vector.is_null();
  Json row{{"valve_id", valve_id},
           {"state", known ? valve.vector["state"] : Json("NOT_CONFIRMED")},
           {"quality", known ? valve.vector["quality"] : Json()},
           {"fault", Json()},
           {"name", Json()},
           {"certainty", known ? valve.vector["certainty"] : Json()},
           {"look_alikes", known ? valve.vector["look_alikes"] : Json::array()},
           {"strength", Json()},
           {"since_utc", Json()},
           {"unconfirmed_utc", Json()}};
  if (InAlarm(valve)) {
    const bool named = valve.event["fault"] != "unknown";
    if (row["state"] != "DETECTED" && row["state"] != "ISOLATED") {
      row["state"] = named ? "ISOLATED" : "DETECTED";
    }
    row["certainty"] = valve.event["certainty"];
    row["look_alikes"] = valve.event["look_alikes"];
    row["strength"] = valve.event["strength"];
    row["since_utc"] = valve.event["detected_utc"];
    if (named || row["certainty"] == "not known") {
      row["fault"] = valve.event["fault"];
    }
  } else if (known && !valve.vector["isolated"].empty()) {
    row["fault"] =
        JoinText(valve.vector["isolated"], "|",
                 [](const Json& fault) { return fault.get<std::string>(); });
  }
  if (row["fault"].is_string()) {
    const double strength =
        row["strength"].is_null() ? 0.0 : row["strength"].get<double>();
    row["name"] = texts_.Words(row["fault"].get<std::string>(), strength).name;
  }
  if (!IsConfirmed(valve, now)) {
    row["state"] = "NOT_CONFIRMED";
    row["unconfirmed_utc"] =
        known ? valve.vector["stamp_utc"] : valve.event["stamp_utc"];
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
  for (const auto& [valve_id, valve] : valves_) {
    if (!valve.vector.is_null() || InAlarm(valve)) {
      Json row = RowOf(valve_id, valve, now);
      rows.emplace_back(std::tuple(Rank(row), valve_id), std::move(row));
    }
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
    return row["unconfirmed_utc"].is_null()
               ? row["state"].get<std::string>()
               : "not confirmed since " +
                     FormatTime(NsOf(row, "unconfirmed_utc"), utc);
  };
  return report.Table(
      "valves",
      {{.heading = "valve", .key = "valve_id", .tone = ToneOf},
       {.heading = "state", .text = state, .tone = ToneOf},
       {.heading = "quality", .key = "quality", .spare = 3},
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
