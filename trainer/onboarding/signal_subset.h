#pragma once

#include "trainer/onboarding/fault_synthesis.h"
#include "trainer/training.h"

namespace fdi::trainer {

/// The run as a valve gives it that measures `signals` alone.
TrainingRun WithSignals(TrainingRun run, SignalMask signals);

/// A healthy valve of the type in the feedwater loop, all transmitters there.
TrainingRun SimulateHealthyRun(const ValveType& type, double duration_s);

/// The `extended` preset for a valve that measures `signals`: channels that
/// need others are left out, the normal observer of X may run on its past.
/// @throws DataError if CV or X is not among them.
TrainingOptions OnboardingPreset(SignalMask signals);

}  // namespace fdi::trainer
