#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/severity.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/fields.h"
#include "storage/database/database.h"
#include "storage/history/episode.h"

namespace fdi::storage {

/// An alarm that an operator has suppressed until a given time.
struct Shelf {
  std::int64_t shelf_id{0};
  std::string valve_id;
  std::optional<std::string> fault;  ///< As in fault_history; nothing: any.
  std::int64_t from_ns{0};
  std::int64_t until_ns{0};
  std::string who;
  std::string comment;
  std::string origin;  ///< "fdi-store anna@host", "console 127.0.0.1", ...
  /// Set if it was ended early: when, by whom and from where.
  std::optional<std::int64_t> ended_ns;
  std::string ended_by;
  std::string ended_origin;
  /// When it was planned; nothing: it began when it was made.
  std::optional<std::int64_t> planned_ns;
};

/// Ordered by their making: those that are not over at a time, in force or
/// planned, or all.
std::vector<Shelf> ReadShelves(Database& database,
                               std::optional<std::int64_t> not_over_at_ns = {});

/// True if it has ended, or somebody has ended it.
bool IsOver(const Shelf& shelf, std::int64_t now_ns);

/// True while it is in force: until it is over, and if it was planned, from its
/// beginning on. Any other one is in force even before its beginning: then a
/// clock was set back, and what somebody has shelved stays shelved.
bool IsActive(const Shelf& shelf, std::int64_t now_ns);

/// True if `shelf` applies to this valve and diagnosis. A shelved fault covers
/// only episodes with exactly this diagnosis: not those that are not isolated,
/// nor those with another fault set.
bool Covers(const Shelf& shelf, const Episode& episode);

/// States of an alarm in ANSI/ISA-18.2-2016 (IEC 62682), alarm state
/// transition diagram. An episode is the alarm. Its condition has returned to
/// normal once it was cleared or has ended; where only the data ended, once the
/// valve was judged normal again. Until then it stays active
/// (Episode::unconfirmed_ns).
enum class AlarmState {
  kUnacked,          ///< Active, not acknowledged.
  kAcked,            ///< Active, acknowledged.
  kReturnedUnacked,  ///< Returned to normal, not acknowledged.
  kNormal,           ///< Returned to normal and acknowledged.
  kShelved,          ///< Suppressed for a limited time.
  kNotice,           ///< No alarm: within the budget of alarms (AlarmBudget).
};

/// "UNACK", "ACKED", "RTN_UNACK", "NORMAL", "SHELVED", "NOTICE".
std::string_view AlarmStateName(AlarmState state);

/// Shelving hides any other state, which reappears when the shelf ends.
AlarmState AlarmStateOf(bool active, bool acknowledged, bool shelved = false);
AlarmState AlarmStateOf(const Episode& episode, bool shelved = false);

/// An episode as operators see it.
struct Alarm {
  Episode episode;
  AlarmState state{AlarmState::kUnacked};  ///< Regardless of the shelf.
  /// The shelf in force now; of several, the one that lasts longest.
  std::optional<Shelf> shelf;
};

/// An episode that ends so is not known to be over: only its data ended.
bool LeavesUnconfirmed(EndReason reason);

/// The observers have found something meanwhile, and their episode says what
/// this one of the audit was (Episode::audit): it has not returned to normal.
bool IsTakenOver(const Episode& episode);

/// When its fault was seen to be gone; nothing while it stands. The end of its
/// data is no return.
std::optional<std::int64_t> ReturnedNs(const Episode& episode);

/// The alarm that `event` belongs to, made from the event alone because it is
/// not, or not yet, in the history.
Alarm AlarmOf(const FaultEvent& event);

/// `episodes` in their order, with the matching `shelves` that are in force.
std::vector<Alarm> AsAlarms(std::vector<Episode> episodes,
                            const std::vector<Shelf>& shelves,
                            std::int64_t now_ns);

/// Alarms that are not shelved, by Severity; medium if it is not known.
struct AlarmCounts {
  std::array<std::uint64_t, kSeverityCount> active{};
  std::array<std::uint64_t, kSeverityCount> unacked{};  ///< Active or not.
};

/// Settings of ComputeAlarmStatistics().
///
/// ANSI/ISA-18.2-2016 (clause on monitoring and assessment) and EEMUA 191 (3rd
/// edition, alarm system metrics) call an alarm chattering if it occurs three
/// times or more within a minute, and stale (here: standing) if it stays for
/// more than 24 hours. An episode needs minutes of evidence to be isolated and
/// to clear, so none could occur three times a minute: the window is half an
/// hour.
struct AlarmCriteria {
  int chattering_episodes{3};
  double chattering_window_s{1800.0};
  double standing_s{86'400.0};
  double flood_window_s{600.0};  ///< Alarm rates are counted per 10 minutes.
};

/// The facts of an episode that the statistics need.
struct AlarmSpan {
  std::string valve_id;
  std::string fault;  ///< As in the view; "" while not isolated.
  std::int64_t detected_ns{0};
  std::optional<std::int64_t> ended_ns;
  std::optional<std::string> label;
  std::optional<std::int64_t> last_ns;  ///< Newest evidence, while open.
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
  std::int64_t chattering{0};  ///< Episodes in a chattering series.
  std::int64_t standing{0};    ///< Episodes that lasted longer than standing_s.
  std::int64_t last_detected_ns{0};
};

struct FaultAlarms {
  std::int64_t episodes{0};
  std::int64_t right{0};  ///< Labelled true, or with the diagnosed fault.
  std::int64_t wrong{0};  ///< Labelled false, or as another fault.
};

/// Quality of the alarms in a period. An episode is counted if it was detected
/// within the period; time in alarm is that part of every episode that lies
/// within the period.
struct AlarmStatistics {
  std::vector<DayAlarms> days;  ///< Days with an alarm, in order.
  std::map<std::string, ValveAlarms> valves;
  std::map<std::string, FaultAlarms> faults;  ///< "": not isolated.
  std::int64_t labelled_true{0};              ///< Label true, or a fault.
  std::int64_t labelled_false{0};             ///< Labelled as no fault.
  std::int64_t unlabelled{0};
  std::int64_t most_in_flood_window{0};  ///< Plant-wide.
};

/// @param spans ordered by detection. Those that end before `since_ns` or begin
///   at `until_ns` or later are ignored.
/// @param now_ns end of open episodes; their newest evidence where that is
///   later because its stamps are ahead of the clock.
AlarmStatistics ComputeAlarmStatistics(const std::vector<AlarmSpan>& spans,
                                       std::int64_t since_ns,
                                       std::int64_t until_ns,
                                       std::int64_t now_ns,
                                       const AlarmCriteria& criteria = {});

}  // namespace fdi::storage

FDI_FIELDS(fdi::storage::Shelf, shelf_id, valve_id, fault, from_ns, until_ns,
           who, comment, origin, ended_ns, ended_by, ended_origin, planned_ns)

FDI_FIELDS(fdi::storage::AlarmSpan, valve_id, fault, detected_ns, ended_ns,
           label, last_ns)
