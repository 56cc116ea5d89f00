#pragma once

#include <array>
#include <limits>
#include <memory>
#include <vector>

#include "diagnosis/decision/observer_evidence.h"
#include "diagnosis/decision/rules.h"
#include "diagnosis/decision/strength_tracker.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/fit_window.h"

namespace fdi {

/// Decision factors of all faults of a model set, d_f for fault f:
/// the largest factor of its observers, and once an episode is open also that
/// of its strength tracker, capped by the evidence
///
///     d_f = min( max(γ_observers, γ_tracker), μ_L(L_best − L_f − a) ),
///
/// μ_L falling from 1 to 0 between the evidence core and support. Normal
/// operation competes in the same way with d_0, without a. A fault that
/// tolerates what is seen, but does not account for it, has at most (1 + T)/2:
/// it can be isolated, but is not sure.
///
/// a allows for interpolation. The error between two trained strengths is the
/// same sample after sample, so that its likelihood adds up to a verdict that
/// says nothing about the fault. It is a share of the effect of the fault, with
/// a variance that is 0 at both ends, as that of a Brownian bridge:
///
///     a = ρ 4 |h (1 − h)| E,   E = Σ_c ½ Σ_k λ^(n−k) r_0²/(S_0 τ_c),
///
/// where the best explanation lies a share h of the way between two strengths
/// (StrengthTracker::Interpolation), ρ is the interpolation allowance, and E
/// how far the normal observer is behind, not counting saturated readings.
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
  void Update(const ObserverBank& bank);

  /// Call before Update(): whether P1, P2 and T1 are as in normal operation.
  void PushInputs(const Sample& sample);

  /// Applies the evidence so far to the factors set by Score().
  void ApplyEvidence(Verdict& verdict) const;

  /// The faults that suit P1, P2 and T1 and that the evidence does not refute:
  /// L_best − L_f − a < `margin`. None while the evidence does not refute
  /// normal operation, or while the best one does not account for what is seen
  /// or does not fit it so far.
  FaultSet Unrefuted(double margin) const;

  /// True if P1, P2 or T1 has moved as each of these faults always moves it.
  bool ShownByInputs(FaultSet faults) const;

  /// The faults that a taught observer explains, and within `margin` as well as
  /// the best explanation; nothing while normal operation does.
  /// @param fitting only those that fit the last t_k samples.
  FaultSet Recognised(double margin, bool fitting) const;

  /// The faults that do not fit the last t_k samples at any strength or sign.
  FaultSet misfits() const { return misfits_; }
  bool judges_fit() const { return plan_->judges_fit(); }

  /// The faults that the evidence refutes (by the support or more), even if the
  /// allowance is that of their own place between two trained strengths: none
  /// where the set has no allowance for interpolation.
  FaultSet Contradicted() const;

  /// The explanation of `faults` with the most evidence, tracked or trained.
  struct Leader {
    const StrengthPath* path{nullptr};  ///< Null: there is none.
    double strength{0.0};               ///< |s|
    double evidence{-std::numeric_limits<double>::infinity()};
  };
  Leader LeaderOf(FaultSet faults) const;
  double normal_evidence() const { return trained_.total(0); }

  /// Raises the evidence of every explanation to at least `least`.
  void RaiseTo(double least);

  /// P1, P2 and T1 may be unusual because of causes beside the faults.
  void Excuse(SignalMask inputs) { excused_ = inputs; }

 private:
  double BestEvidence() const;
  void UpdateEffect(const ObserverBank& bank);
  double Allowance() const;
  double AllowanceOf(double interpolation) const;
  double EvidenceMembership(double behind) const;
  double Cap(Rule rule, const StrengthTracker& tracker, double instant,
             double behind) const;
  bool SuitsInputs(const StrengthTracker& tracker) const;
  bool Fits(const StrengthTracker& tracker) const;

  std::shared_ptr<const FaultPlan> plan_;
  ObserverEvidence trained_;
  std::vector<StrengthTracker> trackers_;       // one per fault and direction
  std::array<double, kMaxChannels> effects_{};  // E by channel
  double allowance_{0.0};                       // a
  FitWindow inputs_;                            // 0 as usual, 5 elsewhere
  SignalMask odd_{0};  // not as usual in most of the last t_k samples
  SignalMask usual_{0};
  SignalMask excused_{0};
  FaultSet misfits_{0};
};

}  // namespace fdi
