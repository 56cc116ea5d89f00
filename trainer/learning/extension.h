#pragma once

#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "trainer/learning/label_plan.h"
#include "trainer/onboarding/fault_synthesis.h"

namespace fdi::trainer {

/// The record that the set of a valve was onboarded from: with more healthy
/// hours, the set is made again.
struct FormerRecord {
  ValveType type;         ///< As it was fitted: where the fit starts.
  SignalMask signals{0};  ///< That the valve measures.
  /// Runs in runs.db, ID[@from:to], also those that hold episodes labelled
  /// false.
  std::vector<std::string> runs;
  std::vector<std::string> files;  ///< FILE[@from:to]
};

/// Runs that limits were set by are not among them, because the time around
/// their episodes is not known to be healthy. Nor are lessons of labels about
/// faults.
///
/// @param labels with the set of the valve as the parent.
/// @param files those that the user names. One of them that the set was made
///   from, by its name without folders, is taken out.
/// @throws NotFoundError if a run or file of the set is gone, naming it.
/// @throws DataError if the set has no physics.
FormerRecord ReadFormerRecord(const std::string& valve, const LabelPlan& labels,
                              const storage::DataDirectory& directory,
                              std::vector<std::string>& files);

}  // namespace fdi::trainer
