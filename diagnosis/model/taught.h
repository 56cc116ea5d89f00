#pragma once

#include <string_view>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// Ends the name of an observer that a label has taught ("f6 0.40 taught"):
/// unlike the others of an onboarded valve, it has seen the fault there. It
/// is part of the stored name.
inline constexpr std::string_view kTaughtMark = " taught";

inline bool IsTaught(const Observer& observer) {
  return observer.name.ends_with(kTaughtMark);
}

/// The next time, the fault is hardly ever of just the same strength: a share
/// of the one that was taught, either way. An observer without neighbours is
/// interpolated as far (FaultPlan).
inline constexpr double kTaughtReach = 0.25;

/// The faults of `named` if all of them have been taught on this valve at about
/// the strengths that are estimated now, findings of the floor not counting;
/// else none.
/// @param strengths by fault index.
template <typename Strengths>
FaultSet TaughtOnly(const ModelSet& models, FaultSet named,
                    const Strengths& strengths) {
  FaultSet taught = 0;
  for (const Observer& observer : models.observers) {
    if (!IsTaught(observer)) {
      continue;
    }
    const auto bit =
        static_cast<std::size_t>(FaultIndex(models, observer.fault));
    const double share = strengths[bit] / observer.strength;
    if (Has(named, bit) && share >= 1.0 - kTaughtReach &&
        share <= 1.0 + kTaughtReach) {
      taught |= FaultSet{1} << bit;
    }
  }
  return taught == (named & ~FindingsOf(models)) ? taught : 0;
}

}  // namespace fdi
