#pragma once

#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "simulator/excitation.h"
#include "simulator/valve_parameters.h"
#include "trainer/difference_observers.h"

namespace fdi::trainer {

/// What valves of one type have in common: how faults act on them. A valve's
/// own baseline, its normal observer and background, stands apart.
struct ValveType {
  std::string name;
  simulator::ValveParameters parameters{};
  /// The command acts linearly from sample to sample instead of held.
  bool interpolated_command{false};
  /// Stand for P1, P2 and T1 where a valve does not measure them.
  simulator::InputRow levels{71.67, 3555.0, 2615.0, 100.7};
};

/// Faults that onboarding prepares observers for, each at several strengths, by
/// fault. Those of transmitters that are not among `signals` are left out, and
/// f14, which the basic signals never show.
std::vector<FaultCondition> OnboardingFaults(SignalMask signals);

}  // namespace fdi::trainer
