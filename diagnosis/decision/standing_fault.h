#pragma once

#include <array>
#include <cstddef>

#include "diagnosis/decision/fault_plan.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// A fault whose effect belongs to what is expected of the valve.
struct StandingFault {
  const StrengthPath* path{nullptr};  ///< Null: none.
  double strength{0.0};               ///< |s|
};

/// The effect of a standing fault on the predictions for one sample by channel.
///
/// Effects on rod and flow multiply, those on every other output add up,
///
///     X_fg = X_g X_f/X_0,   F_fg = F_g F_f/F_0,   y_fg = y_g + (y_f - y_0),
///
/// because a narrowed valve passes a share of the flow, a faulty position
/// transmitter reads a share of the true position, and an offset of another
/// reading is the same whatever else acts.
class StandingEffect {
 public:
  /// @param bank with the predictions of every observer for this sample.
  StandingEffect(const ObserverBank& bank, const ModelSet& models,
                 const StandingFault& standing);

  /// ŷ of an observer, with the standing fault beside its own.
  double Compose(std::size_t channel, double prediction) const;

  /// Deviation of the effect itself: a share of it, and the errors of
  /// interpolation and extrapolation behind it; in units of
  /// ObserverBank::extrapolation().
  double uncertainty(std::size_t channel) const { return errors_[channel]; }

 private:
  std::array<double, kMaxChannels> shifts_{};  // ŷ_f − ŷ_0
  std::array<double, kMaxChannels> ratios_{};  // ŷ_f/ŷ_0; 0: they add up
  std::array<double, kMaxChannels> errors_{};
};

/// Makes `composed`, another bank of the same plan, one to which normal
/// operation is the valve with the standing fault, and a fault is both. The
/// observers of the standing fault stay what they are: this fault alone, at
/// another strength.
void ComposeBank(const ObserverBank& bank, const FaultPlan& plan,
                 const StandingFault& standing, ObserverBank& composed);

}  // namespace fdi
