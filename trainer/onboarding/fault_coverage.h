#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "diagnosis/model_set.h"
#include "trainer/onboarding/fault_synthesis.h"

namespace fdi::trainer {

/// What a model set makes of one fault in one direction.
struct FaultCoverage {
  int fault{0};
  bool negative{false};
  /// Smallest |strength| that is detected, as are all greater ones tried.
  std::optional<double> detectable{};
  /// Smallest |strength| from which on the fault stands in a final set of at
  /// most two.
  std::optional<double> isolable{};
  std::vector<int> look_alikes{};  ///< Beside it in some final set, or instead.
};

/// What becomes visible with one more transmitter.
struct TransmitterGain {
  Signal signal{Signal::kF};
  std::vector<int> detectable{};  ///< Faults that were not.
  std::vector<int> isolable{};    ///< Faults that were not.
};

struct CoverageTable {
  SignalMask signals{0};
  double seconds{0.0};  ///< That a fault was given to show.
  std::vector<FaultCoverage> faults;
  std::vector<TransmitterGain> gains{};
};

/// Scores every condition: `healthy` as it is for 120 s, then with the fault.
/// The engine decides as in service. The strengths are those of the observers:
/// between them and beyond it is interpolation.
///
/// @param healthy Of the valve; what is too long for 15 minutes is cut.
CoverageTable AssessCoverage(std::shared_ptr<const ModelSet> models,
                             const std::vector<FaultCondition>& faults,
                             const FaultSynthesizer& synthesize,
                             const Stretch& healthy, int threads);

/// The gain of `more` over `less`: faults that are detectable or isolable at
/// some strength in one and not in the other.
TransmitterGain GainOf(Signal signal, const CoverageTable& less,
                       const CoverageTable& more);

}  // namespace fdi::trainer
