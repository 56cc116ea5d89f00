#pragma once

#include <vector>

#include "storage/cli/examples.h"

namespace fdi::trainer {

/// Of fdi-trainer, for --help and the manual pages.
std::vector<cli::VerbExamples> Examples();

}  // namespace fdi::trainer
