#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>

#include "report/fault_texts.h"
#include "report/report.h"

namespace fdi::monitor {

/// The table of `watch --table`: the present state of every valve, made of the
/// records that `watch --json` prints.
///
/// The bus hands the last vector and the last events of a valve to who comes
/// late, and it does not say how old they are. So a state counts as confirmed
/// only once the valve has been seen to go on, for as long as it goes on, and
/// unless the alarm ended only with its data. Otherwise the state is
/// NOT_CONFIRMED, with the time of the last evidence.
class WatchTable {
 public:
  using Clock = std::chrono::steady_clock;

  WatchTable(report::FaultTexts texts, bool utc)
      : texts_(std::move(texts)), utc_(utc) {}

  /// @param record as WatchRecord::object; of any topic.
  void Add(const report::Json& record, Clock::time_point now);
  /// The monitor gave the place of the valve to another one. Its row stays
  /// while it has an alarm.
  void Remove(const std::string& valve_id);

  /// {"as_of_utc", "monitor", "valves": [{"valve_id", "state", "quality",
  /// "fault", "name", "certainty", "look_alikes", "strength", "since_utc",
  /// "unconfirmed_utc"}]}, the worst first, and its table: docs/json.md.
  /// @param now_ns UTC, which is only shown.
  report::Report Valves(std::int64_t now_ns, Clock::time_point now) const;

  /// A title, and as many rows as fit into `lines` lines.
  std::string Text(std::size_t lines, std::int64_t now_ns,
                   Clock::time_point now) const;

 private:
  struct Valve {
    report::Json vector;       // Null before the first one, and after Remove().
    report::Json event;        // The last one; null: none was heard.
    std::int64_t stamp_ns{0};  // Of the vector.
    Clock::time_point at;      // Its arrival.
    // Stamp of the last event, if its alarm ended with its data.
    std::int64_t ended_ns{std::numeric_limits<std::int64_t>::min()};
    // A later vector followed the first one, or the end.
    bool goes_on{false};
  };

  static bool InAlarm(const Valve& valve);
  bool IsConfirmed(const Valve& valve, Clock::time_point now) const;
  report::Json RowOf(const std::string& valve_id, const Valve& valve,
                     Clock::time_point now) const;
  std::string Health(Clock::time_point now) const;

  report::FaultTexts texts_;
  bool utc_;
  std::map<std::string, Valve> valves_;
  std::map<std::string, double> periods_s_;  // By hash of the model set.
  struct Monitor {
    std::string text;
    Clock::time_point at;
  };
  std::map<std::string, Monitor> monitors_;
};

}  // namespace fdi::monitor
