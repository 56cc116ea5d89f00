#pragma once

#include "cli/program.h"

namespace fdi::simulator {

void AddRunVerb(cli::Program& program);
void AddReplayVerb(cli::Program& program);
void AddFaultsVerb(cli::Program& program);

}  // namespace fdi::simulator
