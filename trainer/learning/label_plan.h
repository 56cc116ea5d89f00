#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/learning/labelled_episodes.h"
#include "trainer/learning/taught_observers.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The set was made by `fdi-trainer onboard`, or from such a one.
bool IsOnboarded(const ModelSet& models);

/// The settings of a training that its model set does not hold, as JSON. They
/// are stored with the set, so that its next version is made in the same way.
std::string SettingsText(const TrainingOptions& options);

/// Which labels to learn from, and on what to build.
struct LabelRequest {
  std::string parent;  ///< NAME[@VERSION]; empty: the set of the episodes.
  storage::EpisodeFilter filter;
  GivenStrengths strengths;
  std::vector<std::string> runs;  ///< To train on beside the parent's.
};

/// What `train --from-labels` is to train on. Making a plan stores nothing.
///
/// A set of onboarding is not trained anew: it gets observers of the faults
/// that labels name (TeachFrom). Episodes labelled false are left to
/// `fdi-trainer limits`.
struct LabelPlan {
  std::shared_ptr<const ModelSet> parent;
  storage::Lineage lineage;  ///< Of the parent.
  TrainingOptions training;  ///< As the parent was trained.
  /// Those of the parent, less the evidence of episodes that are read anew,
  /// and those of the request.
  std::vector<std::string> runs;
  std::vector<std::string> missing;  ///< Runs of the parent not in runs.db.
  std::vector<LabelledEpisode> learnt;
  std::vector<LabelledEpisode> refused;
  /// The request names runs, or a label says what the parent does not know.
  bool has_news{false};
};

/// Of an onboarded valve, the parent is the active version of its set,
/// whichever of them diagnosed the episodes.
///
/// @throws ConfigError if the episodes are of several sets and no parent is
///   given, or if runs are named for a set of onboarding; NotFoundError if
///   there is no labelled episode, no such run or set; DataError if the valve
///   was changed since it was onboarded.
LabelPlan MakeLabelPlan(const LabelRequest& request,
                        const storage::DataDirectory& directory);

/// @throws DataError naming runs or episodes, why, and the option that does
///   without them; or if there is no news.
void RequireTrainable(const LabelPlan& plan, bool drop_missing,
                      bool skip_refused);

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

/// The parent of `plan`, a set of onboarding, with the observers that its
/// labels teach, and those that the labels before it have taught.
struct Teaching {
  ModelSet models;  ///< Not stored yet.
  std::vector<TaughtObserver> taught;
};
/// @throws DataError naming the episodes, as Teach() and WithTaught().
Teaching TeachFrom(const LabelPlan& plan,
                   const storage::DataDirectory& directory);

/// What `models` calls the episode, with what went before it: the last set of
/// faults, empty for none.
std::vector<int> NameIn(const std::shared_ptr<const ModelSet>& models,
                        const LabelledEpisode& episode);

/// Leaves in `runs` the signals that all of them have, as training demands;
/// nothing changes if one that `parent` reads is missing somewhere, which
/// BuildConditions() then reports.
void RestrictToCommonSignals(const ModelSet& parent,
                             std::vector<TrainingRun>& runs);

}  // namespace fdi::trainer
