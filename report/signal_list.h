#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "report/json_output.h"

namespace fdi::report {

/// Parses signal names, ignoring case.
/// @throws ConfigError naming the first one not in `accepted`, and these.
SignalMask ParseSignals(const std::vector<std::string>& names,
                        SignalMask accepted);

/// Parses "CV,X,F"; all signals are accepted. @throws ConfigError
SignalMask ParseSignals(std::string_view list);

/// "CV,P1"
std::string SignalsText(SignalMask signals);
/// ["CV", "P1"]
Json SignalsJson(SignalMask signals);

}  // namespace fdi::report
