#include "diagnosis/intake.h"

#include <cmath>

namespace fdi {

Intake CheckValues(const ModelSet& models, SignalMask required,
                   const Sample& sample) {
  if ((required & MaskOf(Signal::kF)) != 0 && sample.Has(Signal::kF) &&
      sample.flow_unit != models.flow_unit) {
    return Intake::kUnit;
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((required & MaskOf(signal)) == 0 || !sample.Has(signal)) {
      continue;
    }
    if (sample.quality[i] == SignalQuality::kBad) {
      return Intake::kBadQuality;
    }
    if (!std::isfinite(sample.values[i])) {
      return Intake::kNotFinite;
    }
    if (!PlausibleRange(signal).Contains(sample.values[i])) {
      return Intake::kRange;
    }
  }
  return Intake::kAccepted;
}

}  // namespace fdi
