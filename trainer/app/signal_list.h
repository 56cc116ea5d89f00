#pragma once

#include <string>
#include <vector>

#include "diagnosis/sample.h"

namespace fdi::trainer {

/// The signals called `names`, of the basic measurements.
/// @throws ConfigError naming the first that is none.
SignalMask ParseSignals(const std::vector<std::string>& names);

}  // namespace fdi::trainer
