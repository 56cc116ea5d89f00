#pragma once

#include <functional>
#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/difference_fit.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The samples of a healthy stretch as the valve would have answered with the
/// fault in force all the time. Called from several threads.
using FaultSynthesis =
    std::function<std::vector<Sample>(const FaultCondition&, const Stretch&)>;

/// Builds a model set for a valve that has only ever been healthy: the normal
/// observer is fitted to the healthy runs, a fault observer is ŷ_i = ŷ_0 + δ_i
/// with δ_i a Takagi-Sugeno model of what the fault changes (FitDifference).
/// The mismatch between valve and simulation cancels where the fault is absent,
/// memberships and thresholds rest on the valve's own residuals.
///
/// @param healthy Every sample counts as normal operation.
/// @param faults Ordered by fault. At most kMaxObservers − 1.
/// @param flow_limit Upper limit of the flow transmitter [flow unit].
/// @throws DataError naming run or channel if the runs do not suffice.
ModelSet TrainDifferenceSet(const std::vector<TrainingRun>& healthy,
                            const std::vector<FaultCondition>& faults,
                            const FaultSynthesis& synthesize, double flow_limit,
                            const TrainingOptions& options,
                            const Progress& progress = {});

}  // namespace fdi::trainer
