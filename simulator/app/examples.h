#pragma once

#include <vector>

#include "storage/cli/examples.h"

namespace fdi::simulator {

/// Of fdi-simulator, for --help and the manual pages.
std::vector<cli::VerbExamples> Examples();

}  // namespace fdi::simulator
