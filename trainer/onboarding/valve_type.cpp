#include "trainer/onboarding/valve_type.h"

#include <array>

#include "diagnosis/fault_catalogue.h"

namespace fdi::trainer {
namespace {

constexpr std::array kStrengths{0.1, 0.25, 0.5, 0.75, 1.0};
constexpr std::array kSignedStrengths{0.1, 0.25, 0.5, 0.75};
// Of the span: faults of transmitters are steps.
constexpr std::array kTransmitterStrengths{0.02, 0.1, 0.5, 1.0};

void Add(int fault, const auto& strengths, bool both_ways,
         std::vector<FaultCondition>& faults) {
  for (const double strength : strengths) {
    faults.push_back({fault, strength});
    if (both_ways) {
      faults.push_back({fault, -strength});
    }
  }
}

}  // namespace

std::vector<FaultCondition> OnboardingFaults(SignalMask signals) {
  const auto measured = [&](Signal signal) {
    return (signals & MaskOf(signal)) != 0;
  };
  std::vector<FaultCondition> faults;
  for (int fault = 1; fault <= kFaultCount; ++fault) {
    if (fault == 14 || (fault == 19 && !measured(Signal::kF))) {
      continue;
    }
    // Less play than none there is not: f4 acts one way.
    if (FaultFactsOf(fault).is_signed && fault != 4) {
      Add(fault, kSignedStrengths, true, faults);
    } else {
      Add(fault, kStrengths, false, faults);
    }
  }
  for (int fault = kFaultCount + 1; fault <= kLastFault; ++fault) {
    if (measured(*TransmitterOf(fault))) {
      Add(fault, kTransmitterStrengths, true, faults);
    }
  }
  return faults;
}

}  // namespace fdi::trainer
