#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/learning/labelled_episodes.h"
#include "trainer/training.h"

namespace fdi::trainer {

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

/// @throws ConfigError if the episodes are of several sets and no parent is
///   given; NotFoundError if there is no labelled episode, no such run or set;
///   DataError if the parent was not made by `fdi-trainer train`.
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

/// Leaves in `runs` the signals that all of them have, as training demands;
/// nothing changes if one that `parent` reads is missing somewhere, which
/// BuildConditions() then reports.
void RestrictToCommonSignals(const ModelSet& parent,
                             std::vector<TrainingRun>& runs);

}  // namespace fdi::trainer
