#pragma once

#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/dataset.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// Where a model set of these conditions is at home: where samples are, that is
/// but for the outermost 30 of a condition on each side, or 2 % if these are
/// fewer. Commands from all of them, since the loop answers to a fault; dP, T1,
/// P1 and P2 from normal operation, the first condition. Signals that the runs
/// lack have no bounds.
///
/// Margins: a command outside is a valve that is not judged, so a tenth of the
/// range at least, a quarter of it for its running mean; twice the largest step
/// of CV. dP, T1, P1 and P2 vary more from day to day than within the hours of
/// a training: half of their whole range on each side, at least 5 % of the
/// largest pressure and 10 °C; still far from equal pressures and cold water.
/// Less than 2 % of the largest flow is none.
ValidityRegion TrainedRegion(const std::vector<Condition>& conditions);

/// Ten times the longest run of one reading in normal operation, and a minute:
/// a quantised signal that is at rest repeats itself. Signals that the runs
/// lack are not watched.
StuckLimits FitStuckLimits(const Condition& normal);

/// A model set with everything that runs and options say; channels without
/// thresholds, and no observer yet.
ModelSet DescribeModelSet(const std::vector<TrainingRun>& runs,
                          const std::vector<Condition>& conditions,
                          const TrainingOptions& options);

/// Adds an observer, its channels empty, and its fault: "normal" for fault 0,
/// else "f19 0.50". Call it in the order of the faults.
void AddObserver(int fault, double strength, ModelSet& models);

}  // namespace fdi::trainer
