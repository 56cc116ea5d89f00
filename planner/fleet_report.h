#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "report/fault_texts.h"
#include "report/json_output.h"
#include "report/report.h"
#include "storage/history/common_cause.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// A loop that ought to be watched.
struct FleetLoop {
  std::string valve_id;
  /// How much the plant depends on it: 1 most, 3 least; nothing: not said.
  std::optional<int> grade{};
  std::string finding{};  ///< Why its record could not be used, if known.
};

/// What an audit said about one window of a loop.
struct FleetAudit {
  std::string loop;
  std::string verdict;  ///< As in `fdi-store audit`.
  bool sure{false};
  std::string reason;
  std::optional<double> band_pct{};  ///< Of stiction [% of OP span].
  std::int64_t start_ns{0};
};

/// Loops whose oscillations have one period.
struct FleetPeriod {
  double period_s{0.0};
  std::vector<std::string> loops;
};

/// What a report is about. The history has the episodes, the shelves and the
/// time for which each valve was judged; the rest is known to the caller.
struct FleetQuery {
  std::int64_t now_ns{0};
  std::int64_t since_ns{0};
  std::size_t top{10};  ///< Findings with all their columns.
  std::string software{};
  std::vector<FleetLoop> loops{};
  /// Valves that a model set judges at this moment: the history has the time
  /// judged only up to the last minute.
  std::vector<std::string> judged_now{};
  std::vector<FleetAudit> audits{};
  std::vector<FleetPeriod> periods{};
  /// Loops that no audit could judge, and why.
  std::vector<std::pair<std::string, std::string>> not_audited{};
  std::vector<storage::CommonCause> causes{};
  std::optional<report::Json> last{};  ///< The document of the last report.
  std::string last_file{};             ///< Where it is from.
};

/// The loops that ought to be watched according to models.db: those of the
/// plant's table, and valves with an entry of their own. Empty without the
/// file.
std::vector<FleetLoop> LoopsOf(const std::filesystem::path& models);

/// The common causes of a history.db since `since_ns`, and those that are open,
/// however old.
std::vector<storage::CommonCause> CausesOf(const std::filesystem::path& history,
                                           std::int64_t since_ns);

/// The title of the page.
inline constexpr const char* kFleetTitle = "Loops of the plant";

/// The state of a plant's loops:
///
/// - `worst`, `others`: the findings by severity · grade · confidence. A loop
///   has one finding, the weightiest; loops that share a cause or a period have
///   one in common. Severity: low 1, medium 2, high 4, critical 8. Grade: 1
///   counts 2, 2 and unknown 1, 3 a half. Confidence: ConfidenceOf(); of an
///   audit 0.9 if sure, else 0.5.
/// - `shared`: common causes, and periods that several loops have.
/// - `unjudged`: loops that were judged for less than half of the time.
/// - `shelved`: what operators have put aside, which is no finding.
/// - `changes` since `last`; null without one.
/// - `coverage`, `loops`: what watches each loop.
///
/// docs/json.md has the keys.
/// @param history null: there is none yet, and nothing was judged.
/// @throws DataError if `last` is no document of this function.
report::Report FleetReport(storage::History* history,
                           const report::FaultTexts& texts,
                           const FleetQuery& query);

}  // namespace fdi::planner
