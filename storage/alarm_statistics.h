#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// Settings of ComputeAlarmStatistics().
///
/// ANSI/ISA-18.2-2016 (clause on monitoring and assessment) and EEMUA 191
/// (3rd edition, alarm system metrics) count an alarm as chattering that comes
/// three times or more within a minute, and as stale (a long-standing one)
/// what stays for more than 24 hours. An episode needs minutes to be isolated
/// and to clear on evidence, so that none could come thrice a minute: the
/// window is half an hour.
struct AlarmCriteria {
  int chattering_episodes{3};
  double chattering_window_s{1800.0};
  double standing_s{86'400.0};
  double flood_window_s{600.0};  ///< Alarm rates are counted per 10 minutes.
};

/// What of an episode counts.
struct AlarmSpan {
  std::string valve_id;
  std::string fault;  ///< As in the view; "" while not isolated.
  std::int64_t detected_ns{0};
  std::optional<std::int64_t> ended_ns;
  std::optional<std::string> label;
  std::optional<std::int64_t> last_ns;  ///< While open: of the newest evidence.
};

struct DayAlarms {
  std::int64_t day{0};  ///< UTC, since 1970-01-01.
  std::int64_t episodes{0};
  double alarm_s{0.0};  ///< Summed over the valves.
};

struct ValveAlarms {
  std::int64_t episodes{0};
  std::int64_t open{0};
  double alarm_s{0.0};
  std::int64_t chattering{0};  ///< Episodes that came in such a row.
  std::int64_t standing{0};    ///< Episodes that lasted, or last, too long.
  std::int64_t last_detected_ns{0};
};

struct FaultAlarms {
  std::int64_t episodes{0};
  std::int64_t right{0};  ///< Labelled true, or as this very answer.
  std::int64_t wrong{0};  ///< Labelled false, or as another fault.
};

/// How good the alarms of a time were. An episode is counted if it was
/// detected within the time; time in alarm is that of all episodes, as far as
/// it falls into the time.
struct AlarmStatistics {
  std::vector<DayAlarms> days;  ///< Days with an alarm, in order.
  std::map<std::string, ValveAlarms> valves;
  std::map<std::string, FaultAlarms> faults;  ///< "": not isolated.
  std::int64_t labelled_true{0};              ///< Label true, or a fault.
  std::int64_t labelled_false{0};             ///< No fault was there.
  std::int64_t unlabelled{0};
  std::int64_t most_in_flood_window{0};  ///< Plant-wide.
};

/// @param spans by detection. Those that end before `since_ns` or begin at
///   `until_ns` or later do not count.
/// @param now_ns to which open episodes last; to their newest evidence where
///   stamps are ahead of the clock.
AlarmStatistics ComputeAlarmStatistics(const std::vector<AlarmSpan>& spans,
                                       std::int64_t since_ns,
                                       std::int64_t until_ns,
                                       std::int64_t now_ns,
                                       const AlarmCriteria& criteria = {});

/// By detection: the episodes of the filter's valves and fault that touch its
/// time; its state and limit do not count.
std::vector<AlarmSpan> ReadAlarmSpans(Database& database,
                                      const EpisodeFilter& filter);

}  // namespace fdi::storage
