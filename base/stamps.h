#pragma once

#include <algorithm>
#include <cstdint>

namespace fdi {

// Possible stamps, from 1900 to 2149: the difference of two of them,
// or a day more, fits into 64 bits.
inline constexpr std::int64_t kFirstStampNs = -2'208'988'800'000'000'000;
inline constexpr std::int64_t kLastStampNs = 5'680'281'599'999'999'999;

constexpr bool IsStamp(std::int64_t ns) {
  return ns >= kFirstStampNs && ns <= kLastStampNs;
}

/// The nearest stamp that can be.
constexpr std::int64_t ClampStamp(std::int64_t ns) {
  return std::clamp(ns, kFirstStampNs, kLastStampNs);
}

}  // namespace fdi
