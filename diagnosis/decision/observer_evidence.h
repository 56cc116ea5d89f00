#pragma once

#include <memory>
#include <vector>

#include "diagnosis/decision/fault_plan.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// The evidence for one explanation, L = Σ_c L_c, with separate memory per
/// channel: a channel at its transmitter's limit, or without measured signals,
/// has little information, and its evidence is held until it has more,
///
///     L_c ← λ L_c + gain,   λ = 1 meanwhile.
///
/// Here for every observer at the strength that it was trained for, with the
/// gain −½ (r²/S + ln S)/τ_c for its residual r of variance S.
class ObserverEvidence {
 public:
  explicit ObserverEvidence(std::shared_ptr<const FaultPlan> plan);

  void Clear();

  /// Adds the residuals of one sample.
  void Gather(const ObserverBank& bank);

  /// Raises every sum to at least `least`, in the channel with the strongest
  /// contrary evidence.
  void RaiseTo(double least);

  double total(std::size_t observer) const { return totals_[observer]; }

 private:
  double& Part(std::size_t slot) {
    return parts_[slot / kLanes].lane[slot % kLanes];
  }
  void Sum(std::size_t observer);

  std::shared_ptr<const FaultPlan> plan_;
  std::vector<Quad> parts_;     // by block
  std::vector<double> totals_;  // by observer
};

}  // namespace fdi
