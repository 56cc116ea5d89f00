#pragma once

#include <string>
#include <vector>

#include "diagnosis/sample.h"

namespace fdi::cli {

/// The signals called `names`, in any case.
/// @throws ConfigError naming the first that is none of `accepted`, and these.
SignalMask ParseSignals(const std::vector<std::string>& names,
                        SignalMask accepted);

/// "CV,P1"
std::string SignalsText(SignalMask signals);

}  // namespace fdi::cli
