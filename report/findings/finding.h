#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/valve_identity.h"
#include "report/fault_texts.h"
#include "report/json_output.h"
#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/history/history.h"

namespace fdi::findings {

/// The period of every list unless somebody states another one.
inline constexpr int kPeriodDays = 90;

using Identities = std::map<std::string, ValveIdentity>;  ///< By valve.

/// The facts of a plant that weigh in the rank of an episode.
struct RankFacts {
  Identities valves{};
  /// Counts of labels that called an answer right or wrong, by answer.
  std::map<std::string, storage::FaultAlarms> labels{};
};

/// One thing that is wrong with a valve, as of now. Every view takes name,
/// severity, certainty and rank from this record.
struct Finding {
  std::string valve_id;
  std::string host{};  ///< Host of the monitor; plant history only.
  std::string monitor{};
  std::string kind;  ///< "episode", "audit", "limit", "drift", "figure", or
                     ///< "notice", an episode within the budget of alarms.

  /// Faults as in fault_history, or the verdict of an audit; nothing before a
  /// name, and where no fault is meant.
  std::optional<std::string> fault{};
  /// `check` and `discipline` are empty where there are none.
  report::FaultWords words{};
  std::optional<std::string> layer{};  ///< LayerName() of what named it.
  std::optional<Certainty> certainty{};
  std::vector<std::string> look_alikes{};
  std::string witness{};             ///< storage::WitnessText()
  std::optional<double> strength{};  ///< Signed [-]; nothing before a name.
  ValveIdentity about{};             ///< RankFacts::valves.
  double confidence{1.0};            ///< The weight of certainty, 0..1 [-].

  std::optional<std::int64_t> since_ns{};  ///< When it was detected.
  std::optional<std::int64_t> ended_ns{};  ///< Nothing: it stands.
  /// Since when nothing confirms that it stands.
  std::optional<std::int64_t> unconfirmed_ns{};
  /// Newest evidence. It may be ahead of the clock of this machine.
  std::int64_t last_ns{0};

  std::string episode_id{};
  int episodes{0};        ///< With this fault; an episode has at least one.
  bool confirmed{false};  ///< By a label.
  std::optional<std::string> acked_by{};
  std::optional<std::string> label{};

  bool is_notice() const { return kind == "notice"; }
  bool is_episode() const { return kind == "episode" || is_notice(); }
  bool stands() const { return !ended_ns; }
  /// SeverityPoints() x GradeFactor() x confidence.
  double score() const;
};

/// low 1, medium 2, high 4, critical 8.
double SeverityPoints(Severity severity);
/// The share of findings that are acted on rightly: sure 1, likely 0.75, one of
/// or not known 0.5, not yet 0.25. Conventions, like the points of severity.
double CertaintyFactor(Certainty certainty);
/// 1 counts 2, 3 counts a half, and 2 or nothing 1: a plant that states no
/// grades is ranked by severity and certainty.
double GradeFactor(std::optional<int> grade);

/// The rank of findings: what stands comes before what has ended, an alarm
/// before a notice, then the larger score, then the newer one. Ids decide
/// between equals, so that the same facts give the same list.
bool IsWorse(const Finding& a, const Finding& b);

/// The loops of the plant as models.db has them. @param models its file; need
///   not exist.
/// @throws storage::SqliteError, DataError
Identities ReadIdentities(const std::filesystem::path& models);
/// The identity of a valve; an empty one if nothing is stated.
ValveIdentity IdentityOf(const Identities& valves, const std::string& valve_id);
/// {"description", "service", "location", "document", "grade"}; null if nothing
/// is stated.
report::Json AboutJson(const ValveIdentity& valve);
/// "Feed to column C-101, hall 2, data sheet DS-101"; empty if nothing is
/// stated.
std::string AboutText(const ValveIdentity& valve);

/// Labels of the last kPeriodDays, and ReadIdentities(). @param models file of
/// models.db; need not exist.
/// @throws storage::SqliteError, DataError
RankFacts ReadRankFacts(storage::History& history,
                        const std::filesystem::path& models,
                        std::int64_t now_ns);

/// The present of an episode. Its confidence is 1 if a label says that there
/// was a fault, else CertaintyFactor() times (right + 1) / (right + wrong + 1),
/// counted over the labels that its answer got: without labels an answer is
/// trusted fully, and a single wrong one halves that.
Finding FindingOf(const storage::Episode& episode,
                  const report::FaultTexts& texts, const RankFacts& facts = {});

}  // namespace fdi::findings
