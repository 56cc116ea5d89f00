#pragma once

#include <array>
#include <string>
#include <vector>

#include "diagnosis/model/model_set.h"

namespace fdi::trainer::study {

/// The set as if it had never been told of `faults`: without their observers,
/// groups and declarations. The other observers, the thresholds and the
/// regressors come from normal operation and from their own conditions alone,
/// so that training without those faults gives the same.
///
/// @throws ConfigError naming a fault that the set does not know, and those
///   that it does.
ModelSet WithoutFaults(ModelSet models, const std::vector<int>& faults);

/// The set without the named residual channels (any case), their thresholds and
/// windows. Other channels may still read the signal that they watched.
///
/// @throws ConfigError naming a channel that the set does not have, and those
///   that it has, or if none would be left.
ModelSet WithoutChannels(ModelSet models,
                         const std::vector<std::string>& names);

/// The parts that WithoutParts() can leave out.
inline constexpr std::array<const char*, 4> kParts{"looks", "floor", "windows",
                                                   "early"};

/// The set without the named parts: `looks` by the fitted physics, the `floor`
/// with all findings, a drift of X among them, the limits on `windows`, or the
/// `early` test, which names a fault before t_k.
///
/// @param parts each one of kParts.
ModelSet WithoutParts(ModelSet models, const std::vector<std::string>& parts);

}  // namespace fdi::trainer::study
