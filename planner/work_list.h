#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "planner/channel_drift.h"
#include "planner/health_view.h"
#include "report/fault_texts.h"
#include "report/report.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// A reason to inspect a valve: one diagnosed fault, with all its episodes in
/// the period.
struct FaultReason {
  /// As in fault_history, or from a label; "unknown" also without a name yet.
  std::string fault;
  bool named{true};  ///< False: too early for a name, or over before it.
  report::FaultWords words;
  double strength{0.0};   ///< Estimated, in the newest episode.
  double factor{0.0};     ///< Peak factor of that episode.
  int episodes{0};        ///< Without those labelled false.
  bool confirmed{false};  ///< By a label.
  /// From labels on this diagnosis in the plant: (right + 1) / (right + wrong +
  /// 1).
  double trust{1.0};
  std::string episode_id;       ///< Of the newest episode.
  std::int64_t detected_ns{0};  ///< Of that episode.
  std::optional<std::int64_t> ended_ns;
  /// Since when nothing confirms it, where only its data ended.
  std::optional<std::int64_t> unconfirmed_ns{};
  /// Time of the newest evidence, which may be ahead of this machine's clock.
  std::int64_t last_ns{0};
};

/// A figure that was beyond its limit over the last day of the valve.
struct FigureReason {
  report::FigureText text;
  double value{0.0};        ///< In its own unit, over that day.
  std::int64_t last_ns{0};  ///< The newest hour.
};

/// Everything known of one valve.
struct ValveWork {
  std::string valve_id;
  std::vector<FaultReason> faults;
  std::vector<LimitTrend> trends;
  std::vector<ChannelDrift> drifts{};
  std::vector<FigureReason> figures{};
  /// Since the equipment was last replaced or repaired (its epoch).
  double travel_strokes{0.0};
  double service_hours{0.0};
  double live_share{1.0};  ///< Share of that time that could be judged.
  std::optional<std::int64_t> last_ns;  ///< Its newest hour.
  /// Where that hour comes from; only in the plant history.
  std::string host;
  std::string monitor;
};

/// One line of the list.
struct WorkRow {
  int rank{0};
  double score{0.0};
  ValveWork work;   ///< Its reasons by decreasing weight.
  std::string why;  ///< The reasons in words, in the same order.
};

/// Settings of RankWork().
struct WorkOptions {
  std::int64_t now_ns{0};
  double horizon_days{180.0};   ///< Trends beyond it do not count.
  double half_life_days{30.0};  ///< After the end of an episode.
};

/// The valves with a reason, the most urgent first. A reason has the weight
///
///     S · C · U · R
///
/// S severity in the catalogue at the estimated strength: low 1, medium 2, high
/// 4, critical 8; a limit counts as high. C confidence: 1 if a label confirms
/// the fault, else peak factor times the trust earned by labels on this
/// diagnosis. U urgency: 1 while the episode lasts or the limit is reached; it
/// halves every half_life_days after the end; a limit in t days has 1 −
/// t/horizon_days. R repetition: 1 + 0.1 per further episode, at most 2. A
/// drift, and a figure beyond its limit, is low and halves like the end of an
/// episode from its newest hour on.
/// The score of a valve is its largest weight plus a quarter of the others.
std::vector<WorkRow> RankWork(std::vector<ValveWork> valves,
                              const WorkOptions& options);

/// S: low 1, medium 2, high 4, critical 8.
double SeverityPoints(Severity severity);
/// C, 0..1.
double ConfidenceOf(const FaultReason& reason);

/// S · C · U · R
double WeightOf(const FaultReason& reason, const WorkOptions& options);
double WeightOf(const LimitTrend& trend, const WorkOptions& options);
double WeightOf(const ChannelDrift& drift, const WorkOptions& options);
double WeightOf(const FigureReason& figure, const WorkOptions& options);

/// The reasons in words, in order of decreasing weight.
std::string ReasonText(const ValveWork& work, const WorkOptions& options);

/// Settings of ReadWorkList().
struct WorkQuery {
  std::string valve_glob{"*"};
  std::int64_t since_ns{0};  ///< Episodes from then on, and open ones.
  std::vector<HealthLimit> limits;
  std::string discipline;  ///< Reasons of this one only; empty: any.
  std::size_t top{0};      ///< 0: all.
  WorkOptions options;     ///< now_ns must be set.
};

/// Ranks what the history knows of the plant; see RankWork(). Trends use the
/// hours of health from since_ns on. Episodes that are shelved now are left
/// out.
/// @throws ConfigError for an unknown discipline, naming the accepted ones.
std::vector<WorkRow> ReadWorkList(storage::History& history,
                                  const report::FaultTexts& texts,
                                  const WorkQuery& query);

/// {"rows": [{"rank", "valve_id", "score", "why", "fault", "name",
/// "discipline", "namur", "severity", "check", "strength", "open", "episodes",
/// "episode_id", "detected_utc", "confirmed", "trends": TrendsJson(),
/// "travel_strokes", "service_hours", "live_share", "last_utc"}]}, for people
/// as sentences. `fault` to `confirmed` are those of the weightiest fault; null
/// where there is none; "name", "discipline", "namur" and "check" are then
/// those of the first figure beyond its limit. Rows of the plant's history also
/// have "host" and "monitor".
report::Report WorkListReport(std::span<const WorkRow> rows);

}  // namespace fdi::planner
