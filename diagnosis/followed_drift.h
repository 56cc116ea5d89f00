#pragma once

#include <algorithm>
#include <cstdint>

namespace fdi {

/// Share of its bound from which on a drift is near it [-].
inline constexpr double kNearBound = 0.9;

/// How far the limits of one channel have followed the drift of a healthy valve
/// (Detection::AdaptLimits), and how far they may (DriftLimits). Where the
/// bound is zero nothing is followed.
struct FollowedDrift {
  double mean{0.0};             ///< By which the limits moved, signed [unit].
  double mean_bound{0.0};       ///< In that direction, of its sign [unit].
  double log_scale{0.0};        ///< By which they became wider, at least 0.
  double log_scale_bound{0.0};  ///< Likewise.
  /// Since when no more could be followed; 0 once the drift is not near its
  /// bound any more.
  std::int64_t mean_full_ns{0};
  std::int64_t scale_full_ns{0};

  /// Shares of the bounds that are used, in [0, 1] [-].
  double mean_used() const { return Share(mean, mean_bound); }
  double scale_used() const { return Share(log_scale, log_scale_bound); }
  double used() const { return std::max(mean_used(), scale_used()); }

 private:
  static double Share(double value, double bound) {
    return bound != 0.0 ? value / bound : 0.0;
  }
};

}  // namespace fdi
