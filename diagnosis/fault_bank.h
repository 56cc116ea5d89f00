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
/// operation competes alike with d_0. A fault that no reading since the
/// detection could have refuted has d_f = T/2 at most: it is a candidate, and
/// not named for want of evidence.
class FaultBank {
 public:
  explicit FaultBank(std::shared_ptr<const FaultPlan> plan);
  /// With a plan of its own. `models` must be valid and outlive the bank.
  explicit FaultBank(const ModelSet& models);

  /// Instant factors of all observers and faults from the residuals in `bank`.
  void Score(const ObserverBank& bank, Verdict& verdict) const;

  /// A detection: evidence and strengths begin anew.
  void Restart();

  /// Follows strengths and evidence with the residuals of one more sample of
  /// an open episode.
  void Follow(const ObserverBank& bank);

  /// Lets the evidence so far act on the factors scored by Score().
  void Compete(Verdict& verdict) const;

 private:
  double BestEvidence() const;
  double EvidenceMembership(double behind) const;

  std::shared_ptr<const FaultPlan> plan_;
  ObserverEvidence trained_;
  std::vector<StrengthTracker> trackers_;  // one per fault and direction
};

}  // namespace fdi
