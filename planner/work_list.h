#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/valve_identity.h"
#include "diagnosis/records/loop_audits.h"
#include "planner/health_view.h"
#include "report/fault_texts.h"
#include "report/json_output.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// The list says of so many days at most what could not be judged: of the whole
/// period, a valve that is not judged since yesterday would hardly show.
inline constexpr int kJudgedDays = 7;

/// A loop that ought to be watched.
struct PlannedLoop {
  std::string valve_id;
  ValveIdentity about{};
  std::string finding{};  ///< Why its record could not be used, if known.
  /// The audit's verdict on the record that it was onboarded from.
  std::optional<LoopAudits::Window> verdict{};
};

/// Something was done about a finding, or was ordered.
struct Repair {
  std::string valves{};  ///< Id or glob.
  std::int64_t at_ns{0};
  std::string who{};
  std::string what{};   ///< "recalibrated", "labelled f19"
  bool ordered{false};  ///< In work: not done yet.
  std::string order{};  ///< Its number.
  std::optional<std::int64_t> expected_ns{};  ///< When the valve is to be back.
};

/// The question that a list answers. The history has episodes, shelves, health
/// and the time for which each valve was judged; the rest is known to the
/// caller.
struct WorkQuery {
  std::string valve_glob{"*"};  ///< Selects rows.
  std::int64_t now_ns{0};       ///< The list is as of then; must be set.
  std::int64_t since_ns{0};     ///< Episodes from then on, and open ones.
  std::vector<HealthLimit> limits{};
  std::string discipline{};  ///< Rows of this one only; empty: any.
  std::optional<std::int64_t> stop_ns{};  ///< Can a finding wait until then?
  bool utc{true};                         ///< The day of the stop is of UTC.
  std::string software{};
  std::vector<PlannedLoop> loops{};
  std::vector<Repair> repairs{};  ///< RepairsOf(models)
  /// Valves that a model set judges at this moment: the history has the time
  /// judged only up to the last minute.
  std::vector<std::string> judged_now{};
  LoopAudits audits{};                 ///< From stored runs.
  std::optional<report::Json> last{};  ///< The document of the last list.
  std::string last_file{};             ///< Where it is from.
};

/// The loops that ought to be watched according to models.db: those of the
/// plant's table, and valves with an entry of their own. Empty without the
/// file.
std::vector<PlannedLoop> LoopsOf(const std::filesystem::path& models);
/// The repairs that `valves repaired` noted. Empty without the file.
std::vector<Repair> RepairsOf(const std::filesystem::path& models);

/// The one list of what is wrong, as text, CSV, JSON, page to print and view of
/// the console show it:
///
/// - `rows`: what is wrong, by findings::IsWorse();
/// - `shared`: common causes, and periods that several loops have;
/// - `unjudged`: loops that were judged for less than half of the time;
/// - `shelved`: what operators have put aside, which is no row;
/// - `done`: what was repaired or labelled and has not come back, which is no
///   row either;
/// - `changes` since `last`; null without one;
/// - `coverage`: what watches the loops;
/// - `alarms`: figures of the alarms of the period.
///
/// docs/json.md has the keys.
/// @throws ConfigError for an unknown discipline, naming the accepted ones;
///   DataError if `last` is no such document.
report::Json WorkList(storage::History* history,
                      const report::FaultTexts& texts, const WorkQuery& query);

}  // namespace fdi::planner
