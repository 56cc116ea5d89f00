#pragma once

#include <limits>

#include "diagnosis/model/sample.h"

namespace fdi {

/// A range that holds every value.
inline constexpr SignalRange kUnbounded{
    -std::numeric_limits<double>::infinity(),
    std::numeric_limits<double>::infinity()};

/// Gain of the running mean of CV that ValidityRegion::cv_mean bounds.
inline constexpr double kCvMeanGain = 0.1;
/// Samples until that mean is valid.
inline constexpr int kCvMeanSettling = 30;

/// The region in which the observers of a model set were trained, margins
/// included; see Coverage for valves outside.
struct ValidityRegion {
  SignalRange cv{0.0, 100.0};  ///< Commands [%].
  /// Running mean of CV over about 10 samples [%]: dynamic models were not
  /// fitted where the command stayed only for moments.
  SignalRange cv_mean{kUnbounded};
  double cv_step{200.0};  ///< Largest change of CV from sample to sample [%].
  SignalRange dp{kUnbounded};  ///< P1 − P2 in normal operation [kPa].
  SignalRange t1{kUnbounded};  ///< T1 in normal operation [°C]; superseded by
                               ///< the thresholds of a channel T1, if any.
  SignalRange p1{kUnbounded};  ///< P1 in normal operation [kPa].
  SignalRange p2{kUnbounded};  ///< P2 in normal operation [kPa].
  double flow_cutoff{0.0};     ///< Less is no flow [unit of the flow].
  int rearm_samples{60};       ///< Samples inside before a valve that was
                               ///< outside, or not in AUTO, is judged.
};

}  // namespace fdi
