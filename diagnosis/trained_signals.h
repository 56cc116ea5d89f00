#pragma once

#include <cmath>

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"

namespace fdi {

/// The signals that a set was trained with: those that its channels or its
/// floor read, and P1, P2 and T1 where it knows their usual values or what a
/// fault makes of them. A valve may measure more (onboarding takes --signals):
/// nothing is known of these.
inline SignalMask TrainedSignals(const ModelSet& models) {
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
  return static_cast<SignalMask>(mask);
}

/// The sample as a valve gives it that measures no other signals.
inline Sample WithOnly(Sample sample, SignalMask signals) {
  sample.present &= signals;
  return sample;
}

}  // namespace fdi
