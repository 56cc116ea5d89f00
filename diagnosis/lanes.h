#pragma once

#if defined(__GNUC__) && !defined(__clang__)
// No vector is passed to a function that is not inlined.
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

#include <cmath>
#include <cstdint>
#include <cstring>

#include "diagnosis/exponential.h"
#include "diagnosis/observer_plan.h"

/// Arithmetic on a Quad, always inlined: compiled for whatever instructions the
/// function has that uses it. Every lane has the bits of the scalar operation.
namespace fdi::lanes {

using Lanes = double __attribute__((vector_size(32)));
using Mask = decltype(Lanes{} < Lanes{});

[[gnu::always_inline]] inline Lanes Load(const Quad& quad) {
  Lanes lanes;
  std::memcpy(&lanes, &quad.lane, sizeof lanes);
  return lanes;
}

[[gnu::always_inline]] inline void Store(const Lanes& lanes, Quad& quad) {
  std::memcpy(&quad.lane, &lanes, sizeof lanes);
}

[[gnu::always_inline]] inline void Store(const Lanes& lanes, double* first) {
  std::memcpy(first, &lanes, sizeof lanes);
}

[[gnu::always_inline]] inline Lanes All(double value) {
  return Lanes{value, value, value, value};
}

[[gnu::always_inline]] inline bool Any(const Mask& mask) {
  return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
}

/// std::min and std::max of each lane, NaN included.
[[gnu::always_inline]] inline Lanes Min(const Lanes& a, const Lanes& b) {
  return b < a ? b : a;
}
[[gnu::always_inline]] inline Lanes Max(const Lanes& a, const Lanes& b) {
  return a < b ? b : a;
}

[[gnu::always_inline]] inline Lanes Clamp(const Lanes& value, const Lanes& low,
                                          const Lanes& high) {
  return value < low ? low : (high < value ? high : value);
}

[[gnu::always_inline]] inline Lanes Abs(const Lanes& value) {
  return Lanes{std::abs(value[0]), std::abs(value[1]), std::abs(value[2]),
               std::abs(value[3])};
}

[[gnu::always_inline]] inline Lanes Sqrt(const Lanes& value) {
  return Lanes{std::sqrt(value[0]), std::sqrt(value[1]), std::sqrt(value[2]),
               std::sqrt(value[3])};
}

/// Exp(t) of each lane; −700 < t ≤ 0.
[[gnu::always_inline]] inline Lanes Exp(const Lanes& t) {
  using namespace exponential;
  using Narrow = std::int32_t __attribute__((vector_size(16)));
  using Wide = std::int64_t __attribute__((vector_size(32)));
  const auto k = __builtin_convertvector(t * kLog2E - 0.5, Narrow);
  const auto k_real = __builtin_convertvector(k, Lanes);
  const Lanes r = (t - k_real * kLn2High) - k_real * kLn2Low;
  const Wide bits = (__builtin_convertvector(k, Wide) + 1023) << 52;
  Lanes power;
  std::memcpy(&power, &bits, sizeof power);
  return Series(r) * power;
}

}  // namespace fdi::lanes
