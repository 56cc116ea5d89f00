#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/learning/healthy_residuals.h"
#include "trainer/learning/label_plan.h"
#include "trainer/learning/limits.h"

namespace fdi::trainer {

/// The set that diagnoses the valve, made for it by onboarding.
/// @throws NotFoundError if there is none; DataError if it was made otherwise
/// or
///   in an earlier epoch of the valve.
std::shared_ptr<const ModelSet> OnboardedSet(const std::string& valve,
                                             storage::ModelStore& store);

/// The set of onboarding that `models` has its observers from: itself, unless
/// its limits were set later (StoreLimits) or labels have taught it more.
ModelSet FirstSet(const ModelSet& models, storage::ModelStore& store);

/// Which healthy data the limits of a valve are to be set by.
struct LimitsRequest {
  std::string valve;
  /// ID[@from:to] of runs.db. With no run and no file: every run of the valve
  /// that a monitor recorded.
  std::vector<std::string> runs;
  std::vector<storage::StoredRun> files;
  /// Recorded samples and labelled episodes before do not count; by default the
  /// time at which the observers were made.
  std::optional<std::int64_t> since_ns;
};

/// An episode that was labelled false, and whether the engine would raise an
/// alarm at its samples.
struct FalseAlarm {
  bool alarms_before{false};  ///< With the parent's limits.
  bool alarms_after{false};   ///< With the new ones.
};

/// What the limits of a valve are set by, and what becomes of them. Making it
/// stores nothing.
struct LimitsPlan {
  /// The parent, the episodes labelled false that can be read and those that
  /// cannot; runs: the parent's, then those read here.
  LabelPlan labels;
  std::int64_t since_ns{0};
  std::vector<std::string> runs;         ///< Read here.
  HealthyResiduals healthy;              ///< Without the episodes' samples.
  double episodes_left_out_s{0.0};       ///< With the time around them.
  std::vector<FalseAlarm> false_alarms;  ///< Parallel to labels.learnt.
  std::vector<Peak> peaks;  ///< Of all data, parallel to LimitsOf(parent).
  NewLimits limits;
  std::vector<Visibility> faults;

  const ModelSet& parent() const { return *labels.parent; }
  /// Some limit differs from the parent's.
  bool changes() const;
};

/// Reads the data of the request and sets the limits of the set that is
/// assigned to the valve.
///
/// Healthy are the samples of the runs without those from 10 min before an
/// episode of the valve was detected to its end and the clearing time t_c. What
/// LabelReader reads of episodes that were labelled false counts as healthy,
/// too.
///
/// @throws NotFoundError if the valve has no model set, or there are no healthy
///   data.
/// @throws DataError if the set was not made by `fdi-trainer onboard`, if its
///   baseline is of an earlier epoch, if a run does not suit it, if the data
///   are not those of a healthy valve (RequireHealthy), or if a fault would not
///   be seen any more (RequireVisible).
LimitsPlan MakeLimitsPlan(LimitsRequest request,
                          const storage::DataDirectory& directory);

/// Stores the new set as the next version of its name, active and assigned to
/// the valve, and the samples of the episodes as runs (StoreEvidence).
/// @param software,created_ns of the new set.
/// @returns the set as it is stored, and where it comes from.
ModelSet StoreLimits(LimitsPlan& plan, const std::string& valve,
                     const storage::DataDirectory& directory,
                     const std::string& software, std::int64_t created_ns);

}  // namespace fdi::trainer
