#pragma once

#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// κ per fault and channel (ModelSet::interpolation_errors): for every observer
/// between two of its fault, the root mean square error of interpolating it
/// from its neighbours, per what the interpolation moves from the nearer one;
/// the largest of the fault, within [0.02, 1]. 0.3 where a fault has a single
/// observer.
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
