#pragma once

#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/dataset.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// A model set with everything that runs and options say; channels without
/// thresholds, and no observer yet.
ModelSet DescribeModelSet(const std::vector<TrainingRun>& runs,
                          const std::vector<Condition>& conditions,
                          const TrainingOptions& options);

/// Adds an observer, its channels empty, and its fault: "normal" for fault 0,
/// else "f19 0.50". Call it in the order of the faults.
void AddObserver(int fault, double strength, ModelSet& models);

}  // namespace fdi::trainer
