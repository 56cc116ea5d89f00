#pragma once

#include "trainer/onboarding/fault_synthesis.h"

namespace fdi::trainer {

/// The run as a valve gives it that measures `signals` alone.
TrainingRun WithSignals(TrainingRun run, SignalMask signals);

/// A healthy valve of the type in the feedwater loop, all transmitters there.
TrainingRun SimulatedRun(const ValveType& type, double duration_s);

}  // namespace fdi::trainer
