#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cli/fault_texts.h"
#include "cli/report.h"
#include "monitor/planner/health_view.h"
#include "storage/history/history.h"

namespace fdi::planner {

/// Why somebody should look at a valve: an answer of the diagnosis, with all
/// its episodes in the time looked at.
struct FaultReason {
  std::string fault;  ///< As in fault_history, or what a label says.
  cli::FaultWords words;
  double strength{0.0};   ///< Estimated, of the newest episode.
  double factor{0.0};     ///< Its peak factor.
  int episodes{0};        ///< Without those labelled false.
  bool confirmed{false};  ///< A label says so.
  /// Of labels on this answer in the plant: (right + 1) / (right + wrong + 1).
  double trust{1.0};
  std::string episode_id;       ///< The newest.
  std::int64_t detected_ns{0};  ///< Of it.
  std::optional<std::int64_t> ended_ns;
  /// Of the newest evidence. The clock of this machine may be behind it.
  std::int64_t last_ns{0};
};

/// What is known of one valve.
struct ValveWork {
  std::string valve_id;
  std::vector<FaultReason> faults;
  std::vector<LimitTrend> trends;
  /// Since the equipment was replaced or repaired last (its epoch).
  double travel_strokes{0.0};
  double service_hours{0.0};
  double live_share{1.0};  ///< Of that time, the part that could be judged.
  std::optional<std::int64_t> last_ns;  ///< The newest hour of it.
  /// Where the newest of it is from; in the plant's history alone.
  std::string host;
  std::string monitor;
};

/// One line of the list.
struct WorkRow {
  int rank{0};
  double score{0.0};
  ValveWork work;   ///< Its reasons by weight, the weightiest first.
  std::string why;  ///< The reasons in words, in the same order.
};

/// Settings of RankWork().
struct WorkOptions {
  std::int64_t now_ns{0};
  double horizon_days{180.0};   ///< Trends that need longer do not count.
  double half_life_days{30.0};  ///< Of an episode that has ended.
};

/// The valves with a reason, the most urgent first. A reason weighs
///
///     S · C · U · R
///
/// S severity by the catalogue at the estimated strength: low 1, medium 2,
/// high 4, critical 8; a limit counts as high. C confidence: 1 where a label
/// confirms it, else peak factor times the trust that labels on this answer
/// have earned. U urgency: 1 while the episode lasts or the limit is reached;
/// after its end it halves in half_life_days; a limit in t days has
/// 1 − t/horizon_days. R repetition: 1 + 0.1 per further episode, at most 2.
/// A valve has its weightiest reason and a quarter of the others.
std::vector<WorkRow> RankWork(std::vector<ValveWork> valves,
                              const WorkOptions& options);

/// S · C · U · R
double WeightOf(const FaultReason& reason, const WorkOptions& options);
double WeightOf(const LimitTrend& trend, const WorkOptions& options);

/// The reasons in words, the weightiest first.
std::string WhyText(const ValveWork& work, const WorkOptions& options);

/// Settings of ReadWorkList().
struct WorkQuery {
  std::string valve_glob{"*"};
  std::int64_t since_ns{0};  ///< Episodes from then on, and open ones.
  std::vector<monitor::HealthLimit> limits;
  std::string discipline;  ///< Only reasons of it; empty: any.
  std::size_t top{0};      ///< 0: all.
  WorkOptions options;     ///< now_ns is needed.
};

/// What the history knows of the plant, ranked; see RankWork(). Trends are
/// those of the hours of health from since_ns on.
/// @throws ConfigError for an unknown discipline, naming the accepted ones.
std::vector<WorkRow> ReadWorkList(storage::History& history,
                                  const cli::FaultTexts& texts,
                                  const WorkQuery& query);

/// {"rows": [{"rank", "valve_id", "score", "why", "fault", "name",
/// "discipline", "namur", "severity", "check", "strength", "open", "episodes",
/// "episode_id", "detected_utc", "confirmed", "trends": TrendsJson(),
/// "travel_strokes", "service_hours", "live_share", "last_utc"}]}, for people
/// as sentences. `fault` to `confirmed` are those of the weightiest fault; null
/// where there is none. Rows of the plant's history also have "host" and
/// "monitor".
cli::Report WorkListReport(std::span<const WorkRow> rows);

}  // namespace fdi::planner
