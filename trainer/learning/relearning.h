#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"
#include "trainer/learning/healthy_residuals.h"
#include "trainer/learning/label_plan.h"
#include "trainer/learning/limits.h"

namespace fdi::trainer {

/// The answers of both sets to an episode that was learnt from: the faults that
/// they name; for one labelled false, "alarm" or "no alarm".
struct EpisodeAnswers {
  std::string before;
  std::string after;
};

/// Two sets on the same healthy hours and labelled episodes.
struct ParentComparison {
  double hours{0.0};  ///< Length of the healthy runs.
  int alarms_before{0};
  int alarms_after{0};
  std::vector<EpisodeAnswers> episodes;  ///< Parallel to LabelPlan::learnt.
  std::vector<std::string> worse;  ///< Where the new set is worse; sentences.
};

/// The next version of a set, and how it compares with the one in use. Nothing
/// is stored before StoreRelearned().
struct Relearning {
  LabelPlan labels;
  ModelSet models;  ///< At first the parent, then what each step makes of it.

  std::vector<std::string> runs;    ///< Healthy ones that limits are set by.
  HealthyResiduals healthy;         ///< Without the samples of episodes.
  double episodes_left_out_s{0.0};  ///< With the time around them.
  std::vector<Peak> peaks;          ///< Over all data, by LimitsOf(parent).
  std::optional<NewLimits> limits;  ///< Nothing: no healthy hours are known.
  /// Set if the models were made again: the result that onboarding stores.
  std::optional<storage::ValveResult> anew;
  std::vector<TaughtObserver> taught;
  std::vector<CoverageChange> faults;  ///< Seen from another strength on.
  ParentComparison comparison;

  const ModelSet& parent() const { return *labels.parent; }
  bool changes_limits() const;
};

/// The runs of healthy hours, ID[@from:to]: those that the request names, or
/// else what monitors recorded of the valve in its time. Runs that a request
/// names for a set of `train` are no healthy hours.
std::vector<std::string> HealthyRuns(const RelearnRequest& request,
                                     const LabelPlan& labels,
                                     const storage::DataDirectory& directory);

/// Sets the limits of an onboarded valve by its healthy hours, HealthyRuns()
/// and the files of the request. Healthy are their samples without those from
/// 10 min before an episode of the valve was detected to its end and the
/// clearing time t_c. Samples that LabelReader reads from episodes labelled
/// false count as healthy, too.
///
/// Without healthy hours the limits stay, if there are labels to learn from.
///
/// @throws NotFoundError if hours are asked for and there are none; DataError
/// if
///   a run does not suit the set, or the data are not those of a healthy valve
///   (RequireHealthy).
void LearnHours(const RelearnRequest& request,
                const storage::DataDirectory& directory, Relearning& learnt);

/// Adds the observers that labels of faults teach.
/// @throws as TeachFrom().
void LearnFaults(const storage::DataDirectory& directory, Relearning& learnt);

/// Compares the models with the parent, by episodes that were learnt from and
/// by the healthy hours of LearnHours(), and by `faults`.
void CompareWithParent(const RelearnRequest& request,
                       const storage::DataDirectory& directory,
                       Relearning& learnt);

/// Stores the models as the next version of their name, and the samples of the
/// episodes as runs (StoreEvidence). An active set diagnoses the valve from
/// then on.
/// @param settings of its lineage.
/// @returns the set as it is stored.
ModelSet StoreRelearned(Relearning& learnt, const std::string& valve,
                        const std::string& settings, bool activate,
                        const storage::DataDirectory& directory,
                        const std::string& software, std::int64_t created_ns);

/// The lineage settings of an onboarded valve's set, as JSON.
std::string SettingsText(const Relearning& learnt);

}  // namespace fdi::trainer
