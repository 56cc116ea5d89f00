#pragma once

#include <optional>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// The floor of a valve from its normal operation: the answers of the rod that
/// explain X nearly as well as the best one, the law of the flow, and margins
/// of twice what they err by on these very data, within fixed bounds.
///
/// @param flow_shape as in FloorLimits; then only the gain is fitted.
/// @return Nothing without CV and one of X, F.
std::optional<FloorLimits> FitFloor(const Condition& normal, double period_s,
                                    std::vector<double> flow_shape = {});

/// Widens what the rod may deviate by, and may travel while X repeats, to twice
/// what further normal operation shows, within the same bounds; never narrows.
void WidenFloor(const std::vector<Stretch>& normal, FloorLimits& floor);

}  // namespace fdi::trainer
