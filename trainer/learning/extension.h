#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/onboarding/fault_synthesis.h"

namespace fdi::trainer {

/// What the set of a valve was onboarded from: with healthy hours beside it, it
/// is made anew.
struct FormerRecord {
  std::shared_ptr<const ModelSet> models;  ///< Assigned to the valve now.
  ValveType type;                 ///< As it was fitted: where the fit starts.
  SignalMask signals{0};          ///< That the valve measures.
  std::vector<std::string> runs;  ///< Of runs.db, ID[@from:to]; with those that
                                  ///< hold episodes labelled false.
  std::vector<std::string> files;  ///< FILE[@from:to]
};

/// A file that is not where it was is taken out of `files`, those that the user
/// names, by its name without folders.
///
/// Runs that `fdi-trainer limits` read are not among them: of these, the time
/// around episodes is not known to be healthy.
///
/// @throws NotFoundError if the valve has no set, or a run or file of it is
///   gone, naming it.
/// @throws DataError if the set was not made by onboarding, has no physics, or
///   is of an earlier epoch of the valve.
FormerRecord ReadFormerRecord(const std::string& valve,
                              storage::ModelStore& store,
                              const storage::DataDirectory& directory,
                              std::vector<std::string>& files);

}  // namespace fdi::trainer
