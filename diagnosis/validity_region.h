#pragma once

#include <limits>

#include "diagnosis/sample.h"

namespace fdi {

/// A range that holds every value.
inline constexpr SignalRange kUnbounded{
    -std::numeric_limits<double>::infinity(),
    std::numeric_limits<double>::infinity()};

/// Gain of the running mean of CV that ValidityRegion::cv_mean bounds.
inline constexpr double kCvMeanGain = 0.1;
/// Samples until that mean counts.
inline constexpr int kCvMeanSettling = 30;

/// Where the observers of a model set were trained, margins included; see
/// Coverage for what becomes of a valve outside.
struct ValidityRegion {
  SignalRange cv{0.0, 100.0};  ///< Commands [%].
  /// Its running mean over about 10 samples [%]: models with a past were not
  /// fitted to a command that stays where it was for moments only.
  SignalRange cv_mean{kUnbounded};
  double cv_step{200.0};  ///< Largest change of CV from sample to sample [%].
  SignalRange dp{kUnbounded};  ///< P1 − P2 in normal operation [kPa].
  SignalRange t1{kUnbounded};  ///< T1 likewise [°C]; the thresholds of a
                               ///< channel T1, if there is one, hold instead.
  SignalRange p1{kUnbounded};  ///< P1 alike [kPa].
  SignalRange p2{kUnbounded};  ///< P2 alike [kPa].
  double flow_cutoff{0.0};     ///< A flow below is none [unit of the flow].
  int rearm_samples{60};       ///< Inside before a valve that was outside, or
                               ///< in another mode than AUTO, is judged again.
};

}  // namespace fdi
