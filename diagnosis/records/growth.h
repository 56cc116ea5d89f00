#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "diagnosis/records/strength_point.h"

namespace fdi {

/// The rate at which |strength| changes, with its 95 % interval [1/day].
struct GrowthRate {
  double per_day{0.0};
  double lowest{0.0};
  double highest{0.0};

  bool grows() const { return lowest > 0.0; }
  bool falls() const { return highest < 0.0; }
};

/// From the last point until |strength| = 1, with its 95 % interval [s].
struct TimeToFull {
  double seconds{0.0};
  double lowest{0.0};
  double highest{0.0};
};

/// The development of one fault of an episode.
struct Growth {
  StrengthPoint last;
  std::optional<GrowthRate> rate;  ///< Nothing: too few points, or too short.
  std::optional<TimeToFull> full;  ///< Only if it grows, and is not full yet.
};

/// A rate needs this many points, which share no reading,
inline constexpr int kMinPoints = 3;
/// over so much time.
inline constexpr std::int64_t kMinSpanNs = 1'200'000'000'000;
/// A point is the mean of readings of at most so much time.
inline constexpr std::int64_t kPointWindowNs = 420'000'000'000;

/// The straight line through |strength| over time,
///
///     s(t) = level + rate (t − middle),
///
/// by least squares with weights 1/σ², where 2·1.96 σ is the length of the
/// interval of a point, σ ≥ 0.005. Variances are larger by χ²/(n − 2) if that
/// is above 1: points then scatter more than their intervals say. Quantiles are
/// those of Student's t with n − 2 degrees of freedom; the time to full
/// strength has the interval of Fieller's theorem, which ends wherever the rate
/// is significant. That time also allows for all strengths being off by one
/// share, of deviation 0.02, which their scatter does not tell.
///
/// Only points of `fault` and of the layer of the last of them count, and of
/// those that share readings the latest.
///
/// @param points of one episode, by stamp.
/// @returns nothing if no point is of `fault`.
std::optional<Growth> GrowthOf(std::span<const StrengthPoint> points,
                               int fault);

}  // namespace fdi
