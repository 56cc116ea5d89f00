#pragma once

#include <optional>
#include <string_view>

#include "diagnosis/model/sample.h"

namespace fdi::importer {

/// The mode that a controller's word means: those of kValveModeNames, AUT, CAS,
/// MAN, ...; nothing for other words and for numbers.
std::optional<ValveMode> ModeOfWord(std::string_view word);

}  // namespace fdi::importer
