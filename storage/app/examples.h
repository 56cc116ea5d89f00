#pragma once

#include <vector>

#include "storage/cli/examples.h"

namespace fdi::storage {

/// Of fdi-store, for --help and the manual pages.
std::vector<cli::VerbExamples> Examples();

}  // namespace fdi::storage
