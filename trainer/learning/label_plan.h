#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/history/episode.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/learning/labelled_episodes.h"
#include "trainer/learning/taught_observers.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// Keys of the lineage of a relearnt set, about an onboarded valve: its models
/// were made again, its limits were set, labels taught it faults.
inline constexpr const char* kModelsKey = "models";
inline constexpr const char* kLimitsKey = "limits";
inline constexpr const char* kTaughtKey = "taught";

/// The set was made by `fdi-trainer onboard`, or from such a one.
bool IsOnboarded(const ModelSet& models);

/// The settings of a training that its model set does not hold, as JSON. They
/// are stored with the set, so that its next version is made in the same way.
std::string SettingsText(const TrainingOptions& options);

/// The set of onboarding that `models` has its observers from: itself, unless
/// its limits were set later or labels have taught it more.
ModelSet FirstSet(const ModelSet& models, storage::ModelStore& store);

/// The labels and healthy hours to learn from, as the user names them.
struct RelearnRequest {
  std::string valve;  ///< Its id; a glob if several valves share the set.
  std::optional<std::int64_t> from_ns{};  ///< Limits on samples and episodes.
  std::optional<std::int64_t> to_ns{};
  /// ID[@from:to] of runs.db: healthy hours. For a set of `train`: runs to
  /// train on beside its own.
  std::vector<std::string> runs{};
  std::vector<storage::StoredRun> files{};  ///< Healthy hours.
  GivenStrengths strengths{};
};

/// The lessons of labels, and the set to build on. Making a plan stores
/// nothing.
///
/// A set of `train` is trained again, on its own runs and the episodes. A set
/// of onboarding learns each label by itself: episodes labelled false are
/// healthy hours, and faults become observers (TeachFrom).
struct LabelPlan {
  std::shared_ptr<const ModelSet> parent;
  storage::Lineage lineage;  ///< Lineage of the parent.
  TrainingOptions training;  ///< As the parent was trained.
  /// All episodes of the valve, labelled or not, by detection.
  std::vector<storage::Episode> episodes;
  /// Recorded samples before do not count.
  std::int64_t since_ns{0};
  /// The runs of the parent, without the evidence of episodes that are read
  /// again, and those of the request.
  std::vector<std::string> runs;
  std::vector<std::string> missing;  ///< Runs of the parent not in runs.db.
  std::vector<LabelledEpisode> learnt;
  std::vector<LabelledEpisode> refused;
  /// The request names runs to train on, or a label says what the parent does
  /// not know. For a set of onboarding: a label that names a fault.
  bool has_news{false};
};

/// The parent is the set that is assigned to the valve, or else the active
/// version of the one that diagnosed its labelled episodes. By default episodes
/// of an onboarded valve that are labelled false count since its observers were
/// made, all others whenever they were.
///
/// @throws ConfigError if the episodes are of several sets and none is
/// assigned;
///   NotFoundError if there is neither a set nor a labelled episode, no
///   such run or set; DataError if the valve was changed since it was
///   onboarded.
LabelPlan MakeLabelPlan(const RelearnRequest& request,
                        const storage::DataDirectory& directory);

/// @throws DataError naming runs, or episodes of which the models are to learn,
///   and why they cannot be used.
void RequireUsable(const LabelPlan& plan);

/// "episode 00c0ffee12345678 of valve LV-1, label true: too short: ..."
std::string RefusalText(const LabelledEpisode& episode);

/// Stores the samples of the learnt episodes as runs of their own in runs.db,
/// with the truth that the label implies, so that the training can be repeated
/// when traces and recorded runs are gone. A run that is there already is used
/// again. Names each run in `meaning.run`.
/// @returns how many runs are new. @throws DataError, storage::SqliteError
int StoreEvidence(LabelPlan& plan, const storage::DataDirectory& directory,
                  const std::string& software);

/// The parent and every episode that the new set has learnt from, by itself or
/// through its parent.
storage::Lineage LineageOf(const LabelPlan& plan);

/// `models`, the parent of `plan` or what was made of it, with the observers
/// that its labels teach, and those that the labels before it have taught.
struct Teaching {
  ModelSet models;  ///< Not stored yet.
  std::vector<TaughtObserver> taught;
};
/// @throws DataError naming the episodes, as Teach() and WithTaught().
Teaching TeachFrom(const LabelPlan& plan, const ModelSet& models,
                   const storage::DataDirectory& directory);

/// The name that `models` gives the episode, with what went before it: the last
/// set of faults, empty for none.
std::vector<int> NameIn(const std::shared_ptr<const ModelSet>& models,
                        const LabelledEpisode& episode);

/// Leaves in `runs` the signals that all of them have, as training demands;
/// nothing changes if one that `parent` reads is missing somewhere, which
/// BuildConditions() then reports.
void RestrictToCommonSignals(const ModelSet& parent,
                             std::vector<TrainingRun>& runs);

}  // namespace fdi::trainer
