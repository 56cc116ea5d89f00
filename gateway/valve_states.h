#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "gateway/mqtt_client.h"
#include "monitor/bus/watch_table.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "report/json_output.h"
#include "storage/history/alarm.h"

namespace fdi::gateway {

/// A valve in a topic: /, +, # and % as %2F, ...; and back.
std::string TopicLevel(std::string_view valve_id);
std::string ValveOfLevel(std::string_view level);

/// Makes the messages of all valves from the records of `fdi-monitor watch
/// --json`: fdi/SITE/VALVE/state, fdi/SITE/VALVE/event, fdi/SITE/monitor;
/// docs/connect.md has their keys.
///
/// A state is NORMAL only while a monitor judges samples of the valve.
/// Otherwise its health is CHECK_FUNCTION, with the reason. One thread, no
/// clock.
class ValveStates {
 public:
  using Clock = std::chrono::steady_clock;

  ValveStates(report::FaultTexts texts, const std::string& site)
      : texts_(texts),
        table_(std::move(texts), true),
        prefix_("fdi/" + TopicLevel(site) + "/") {}

  /// @param record as WatchRecord::object; of any topic.
  void Add(const report::Json& record, Clock::time_point now);
  void Remove(const std::string& valve_id) { table_.Remove(valve_id); }
  /// A valve that ought to be there.
  void Expect(const std::string& valve_id) { expected_.insert(valve_id); }
  /// States that a broker has kept from an earlier run: their valves may be
  /// gone, but ought to be there.
  std::string kept_topics() const { return prefix_ + "+/state"; }
  void TakeKept(const MqttEvent& event);
  /// Where and what the valve is; `about` of its state is
  /// findings::AboutJson().
  void Describe(const std::string& valve_id, const std::string& group,
                const ValveIdentity& identity) {
    groups_[valve_id] = group;
    identities_[valve_id] = identity;
  }
  /// The alarms of all valves that somebody has still to see or that stand.
  /// @param alarms nothing: the history cannot be read.
  void SetAlarms(const std::optional<std::vector<storage::Alarm>>& alarms);
  /// All states go out again: the connection is a new one.
  void Forget() { published_.clear(); }

  /// Events that have come, then states that have changed, or were told a
  /// minute ago: `as_of_utc` goes on. Call once a second.
  /// @param missing also valves of which no monitor tells; false while a
  ///   monitor may just not have been heard yet.
  std::vector<Outgoing> Due(std::int64_t now_ns, Clock::time_point now,
                            bool missing = true);
  /// The last will: the monitor's topic while this program is not running.
  Outgoing Farewell() const;

  std::size_t valves() const { return valves_; }

 private:
  struct Published {
    std::string payload;  // Without as_of_utc.
    Clock::time_point at;
  };
  report::Json StateOf(const report::Json& row, bool monitored) const;
  report::Json AlarmOf(const storage::Alarm& alarm) const;
  report::Json KnownOf(const std::string& valve_id) const;
  void Tell(const std::string& topic, report::Json state,
            const report::Json& as_of, Clock::time_point now,
            std::vector<Outgoing>& due);

  report::FaultTexts texts_;
  monitor::WatchTable table_;
  std::string prefix_;
  std::vector<report::Json> new_events_;
  std::set<std::string> expected_;
  std::map<std::string, std::string> groups_;
  findings::Identities identities_;
  bool has_history_{false};
  std::map<std::string, report::Json> alarms_;  // Arrays, by valve.
  std::map<std::string, Published> published_;  // By topic.
  std::size_t valves_{0};
};

}  // namespace fdi::gateway
