#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/cli/program.h"
#include "storage/lineage.h"
#include "trainer/app/labelled_episodes.h"
#include "trainer/app/train_options.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// What `train --from-labels` is to train on; nothing of it is stored yet.
struct LabelPlan {
  std::shared_ptr<const ModelSet> parent;
  storage::Lineage lineage;  ///< Of the parent.
  TrainingOptions training;  ///< As of the parent, but for what was said.
  /// Of the parent, less the evidence of episodes that are read anew, and of
  /// --runs.
  std::vector<std::string> runs;
  std::vector<std::string> missing;  ///< Of the parent, not in runs.db.
  std::vector<LabelledEpisode> learnt;
  std::vector<LabelledEpisode> refused;
};

/// @throws ConfigError, NotFoundError, DataError, storage::SqliteError
LabelPlan MakeLabelPlan(const TrainOptions& options,
                        const cli::Context& context);

/// @throws DataError naming runs or episodes, why, and the option that does
///   without them; or if there is nothing that the parent has not learnt.
void RequireTrainable(const TrainOptions& options, const LabelPlan& plan);

/// "episode 00c0ffee12345678 of valve LV-1, label true: too short: ..."
std::string RefusalText(const LabelledEpisode& episode);

/// "a, b"
std::string Joined(const std::vector<std::string>& words);

/// "NAME@VERSION"
std::string NameOf(const ModelSet& models);

}  // namespace fdi::trainer
