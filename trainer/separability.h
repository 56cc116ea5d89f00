#pragma once

#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Sets ChannelObserver::interpolation_error of every observer between two of
/// its fault (normal operation counts as strength 0): the root mean square
/// error of interpolating it from its neighbours, less 0.3 deviations of its
/// residual, per what the interpolation moves from the nearer one; within
/// [0.02, 1]. The strongest observer takes over that of its neighbour; one
/// without any neighbour of its fault keeps 0.5.
///
/// @param conditions parallel to models.observers.
void FitInterpolationErrors(const std::vector<Condition>& conditions,
                            ModelSet& models);

/// Fills ModelSet::groups and ModelSet::undetectable by scoring the validation
/// stretches of every fault condition: a fault is undetectable if under 5 % of
/// its samples are beyond a threshold; faults i and l form a group if while i
/// acts d_l ≥ T in more than half of the samples.
///
/// @param conditions parallel to models.observers.
void FindGroups(const std::vector<Condition>& conditions, ModelSet& models);

}  // namespace fdi::trainer
