#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "cli/json_output.h"
#include "diagnosis/sample.h"

namespace fdi::cli {

/// The signals called `names`, in any case.
/// @throws ConfigError naming the first that is none of `accepted`, and these.
SignalMask ParseSignals(const std::vector<std::string>& names,
                        SignalMask accepted);

/// "CV,X,F", of all signals there are. @throws ConfigError
SignalMask ParseSignals(std::string_view list);

/// "CV,P1"
std::string SignalsText(SignalMask signals);
/// ["CV", "P1"]
Json SignalsJson(SignalMask signals);

}  // namespace fdi::cli
