#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "report/fault_texts.h"
#include "report/report.h"

namespace fdi::monitor {

/// The table of `watch --table`: the state of every valve as its monitor tells
/// it on the bus. Once that monitor is silent, nothing is confirmed.
class WatchTable {
 public:
  using Clock = std::chrono::steady_clock;

  WatchTable(report::FaultTexts texts, bool utc)
      : texts_(std::move(texts)), utc_(utc) {}

  /// @param record as WatchRecord::object; of any topic.
  void Add(const report::Json& record, Clock::time_point now);
  /// The monitor gave the place of the valve to another one.
  void Remove(const std::string& valve_id) { states_.erase(valve_id); }

  /// {"as_of_utc", "monitor", "valves"}, the worst first: the states with the
  /// `name` of the fault (docs/json.md); and its table.
  /// @param now_ns UTC, which is only shown.
  report::Report Valves(std::int64_t now_ns, Clock::time_point now) const;

  /// A title, and as many rows as fit into `lines` lines.
  std::string Text(std::size_t lines, std::int64_t now_ns,
                   Clock::time_point now) const;

 private:
  report::Json RowOf(const report::Json& state, Clock::time_point now) const;
  bool IsHeard(const report::Json& monitor, Clock::time_point now) const;
  std::string Health(Clock::time_point now) const;

  report::FaultTexts texts_;
  bool utc_;
  std::map<std::string, report::Json> states_;  // By valve.
  struct Monitor {
    std::string text;
    Clock::time_point at;
  };
  std::map<std::string, Monitor> monitors_;
};

}  // namespace fdi::monitor
