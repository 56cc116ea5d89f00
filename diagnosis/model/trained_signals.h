#pragma once

#include <cmath>
#include <limits>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"

namespace fdi {

/// The sample of a valve that is judged at its position: CV is the reading of
/// X, and X is not measured. Nothing behind this knows of the command.
inline Sample PositionAsCommand(Sample sample) {
  const bool measured = sample.Has(Signal::kX);
  sample.present = static_cast<SignalMask>(
      sample.present & ~(MaskOf(Signal::kCv) | MaskOf(Signal::kX)));
  if (measured) {
    sample.Set(Signal::kCv, sample[Signal::kX]);
  }
  sample.quality[Index(Signal::kCv)] = sample.quality[Index(Signal::kX)];
  sample.quality[Index(Signal::kX)] = SignalQuality::kGood;
  return sample;
}

/// Makes the models of a set read the samples of a valve as if it measured no
/// other signals than those that the set was trained with. They are those that
/// its channels or its floor read, and P1, P2 and T1 where it knows their usual
/// values or what a fault makes of them. A valve may measure more (onboarding
/// takes --signals): nothing is known of these.
class TrainedSignals {
 public:
  /// Every signal as it is.
  TrainedSignals() = default;

  explicit TrainedSignals(const ModelSet& models)
      : position_as_command_(models.position_as_command) {
    unsigned mask = RequiredSignals(models) | MaskOf(Signal::kCv);
    const auto add = [&mask](Signal signal, bool trained) {
      mask |= trained ? MaskOf(signal) : 0U;
    };
    const ValidityRegion& region = models.validity;
    const bool dp = std::isfinite(region.dp.maximum);
    add(Signal::kP1, dp || std::isfinite(region.p1.maximum));
    add(Signal::kP2, dp || std::isfinite(region.p2.maximum));
    add(Signal::kT1, std::isfinite(region.t1.maximum));
    for (const Observer& observer : models.observers) {
      mask |= observer.moved;
    }
    add(Signal::kF, models.floor && models.floor->flow_gain > 0.0);
    mask_ = static_cast<SignalMask>(mask);
  }

  /// The sample as the models read it. The engine, the second look and scoring
  /// see the samples of a valve only in this form.
  Sample Of(const Sample& measured) const {
    Sample sample =
        position_as_command_ ? PositionAsCommand(measured) : measured;
    sample.present &= mask_;
    return sample;
  }

 private:
  SignalMask mask_{std::numeric_limits<SignalMask>::max()};
  bool position_as_command_{false};
};

}  // namespace fdi
