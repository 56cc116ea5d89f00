#pragma once

#include "report/program.h"

namespace fdi::simulator {

void AddRunVerb(report::Program& program);
void AddReplayVerb(report::Program& program);

}  // namespace fdi::simulator
