#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "console/live_board.h"
#include "diagnosis/decision/certainty.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "report/json_output.h"
#include "storage/history/alarm.h"

/// JSON of the console's responses; the keys are those of docs/api.md.
namespace fdi::console {

using report::Json;
using report::JsonText;

/// ns to ms since 1970.
Json Ms(std::int64_t stamp_ns);
Json Ms(const std::optional<std::int64_t>& stamp_ns);
/// Rounded to `decimals`; null if it is not finite.
Json Rounded(double value, int decimals);
Json Rounded(const std::optional<double>& value, int decimals);
/// The reading of `signal`, null if it is missing: rounded to `decimals`, or,
/// of a PV and its set point, whose unit nobody knows, to seven digits.
Json ReadingJson(const Sample& sample, Signal signal, int decimals);
/// Null if the text is empty or missing.
Json TextOrNull(const std::string& text);
Json TextOrNull(const std::optional<std::string>& text);

/// Alarm state of a valve.
struct ValveAlarm {
  std::optional<std::int64_t> since_ns;
  std::string episode;  ///< Empty: none is open.
  bool active{false};   ///< The fault is there as far as anybody knows.
  bool unacked{false};
  std::optional<std::int64_t> shelved_until_ns;
  std::optional<std::int64_t> shelf_planned_ns;  ///< Begin of the next one.
  // Facts on the active alarm.
  std::optional<Severity> severity;
  std::optional<double> strength;  ///< Nothing: it has no name.
  std::optional<std::int64_t> unconfirmed_ns;
  std::string fault;  ///< Empty: it has no name.
  /// It is open, and of the audit: decision vectors of a model set do not show
  /// it.
  bool by_audit{false};
  Certainty certainty{Certainty::kNotYet};
  std::vector<std::string> look_alikes{};
  std::optional<std::string> second{};  ///< Episode::second.

  bool operator==(const ValveAlarm&) const = default;
};

/// @param newest_only include "v", the newest point of the sparkline, instead
///   of "spark".
Json TileJson(const ValveState& valve, const ValveAlarm& alarm,
              bool newest_only = false);

Json ModelFactsJson(const ModelFacts& models);

/// One instant of a valve, as sent on the stream.
Json SampleJson(const std::string& valve_id, const TracePoint& point);
/// Many instants as columns.
/// @param models null: no residuals, thresholds or factors.
Json TrendJson(const ModelFacts* models, const std::string& valve_id,
               const std::vector<TracePoint>& points);
Json GapJson(const DataGap& gap);

Json AlarmJson(const storage::Alarm& alarm, const report::FaultTexts& texts,
               const findings::RankFacts& facts = {});
Json AlarmsJson(const std::vector<storage::Alarm>& alarms,
                const report::FaultTexts& texts,
                const findings::RankFacts& facts);
Json ShelfJson(const storage::Shelf& shelf);

}  // namespace fdi::console
