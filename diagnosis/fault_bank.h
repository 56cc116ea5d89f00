#pragma once

#include <memory>
#include <vector>

#include "diagnosis/observer_evidence.h"
#include "diagnosis/strength_tracker.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// Decision factors of all faults of a model set, d_f for fault f:
/// the largest factor of its observers, and once an episode is open also that
/// of its strength tracker, capped by the evidence
///
///     d_f = min( max(γ_observers, γ_tracker), μ_L(L_best − L_f) ),
///
/// μ_L falling from 1 to 0 between the evidence core and support. Normal
/// operation competes in the same way with d_0. A fault that no reading since
/// the detection could have refuted has at most d_f = T/2: it is a candidate,
/// but absence of contrary evidence does not isolate it.
class FaultBank {
 public:
  explicit FaultBank(std::shared_ptr<const FaultPlan> plan);
  /// Makes its own plan. `models` must be valid and outlive the bank.
  explicit FaultBank(const ModelSet& models);

  /// Instantaneous factors of all observers and faults from `bank`'s residuals.
  void Score(const ObserverBank& bank, Verdict& verdict) const;

  /// Resets evidence and strengths at a detection.
  void Restart();

  /// Updates strengths and evidence with the residuals of one more sample of an
  /// open episode.
  void Follow(const ObserverBank& bank);

  /// Applies the evidence so far to the factors set by Score().
  void Compete(Verdict& verdict) const;

 private:
  double BestEvidence() const;
  double EvidenceMembership(double behind) const;

  std::shared_ptr<const FaultPlan> plan_;
  ObserverEvidence trained_;
  std::vector<StrengthTracker> trackers_;  // one per fault and direction
};

}  // namespace fdi
