#pragma once

#include <vector>

#include "storage/cli/examples.h"

namespace fdi::monitor {

/// Of fdi-monitor, for --help and the manual pages.
std::vector<cli::VerbExamples> Examples();

}  // namespace fdi::monitor
