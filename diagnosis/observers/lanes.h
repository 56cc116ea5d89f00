#pragma once

// Vectors are never passed to functions that are not inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "diagnosis/model/exponential.h"
#include "diagnosis/observers/observer_plan.h"

#define FDI_INLINE [[gnu::always_inline]] inline

/// Arithmetic on a Quad. Always inlined, so that it is compiled for the
/// instruction set of the calling function. Every lane has the same bits as the
/// scalar operation.
namespace fdi::lanes {

/// In one AVX2 register.
using Wide = double __attribute__((vector_size(32)));
using WideMask = decltype(Wide{} < Wide{});

/// In two registers.
struct Pair {
  using Half = double __attribute__((vector_size(16)));
  Half low;
  Half high;

  FDI_INLINE double operator[](std::size_t i) const {
    return i < 2 ? low[i] : high[i - 2];
  }
};
struct PairMask {
  using Half = decltype(Pair::Half{} < Pair::Half{});
  Half low;
  Half high;

  FDI_INLINE bool operator[](std::size_t i) const {
    return i < 2 ? low[i] != 0 : high[i - 2] != 0;
  }
};

template <typename Lanes>
FDI_INLINE Lanes Load(const Quad& quad) {
  Lanes lanes{};
  std::memcpy(&lanes, &quad.lane, sizeof lanes);
  return lanes;
}
template <typename Lanes>
FDI_INLINE void Store(const Lanes& lanes, double* first) {
  std::memcpy(first, &lanes, sizeof lanes);
}
template <typename Lanes>
FDI_INLINE void Store(const Lanes& lanes, Quad& quad) {
  Store(lanes, quad.lane.data());
}

template <typename Lanes>
FDI_INLINE Lanes All(double value) {
  if constexpr (std::is_same_v<Lanes, Pair>) {
    return {Pair::Half{value, value}, Pair::Half{value, value}};
  } else {
    return Wide{value, value, value, value};
  }
}

FDI_INLINE Pair operator+(const Pair& a, const Pair& b) {
  return {a.low + b.low, a.high + b.high};
}
FDI_INLINE Pair operator-(const Pair& a, const Pair& b) {
  return {a.low - b.low, a.high - b.high};
}
FDI_INLINE Pair operator*(const Pair& a, const Pair& b) {
  return {a.low * b.low, a.high * b.high};
}
FDI_INLINE Pair operator/(const Pair& a, const Pair& b) {
  return {a.low / b.low, a.high / b.high};
}
FDI_INLINE Pair operator+(double a, const Pair& b) {
  return {a + b.low, a + b.high};
}
FDI_INLINE Pair operator+(const Pair& a, double b) {
  return {a.low + b, a.high + b};
}
FDI_INLINE Pair operator-(const Pair& a, double b) {
  return {a.low - b, a.high - b};
}
FDI_INLINE Pair operator*(double a, const Pair& b) {
  return {a * b.low, a * b.high};
}
FDI_INLINE Pair operator*(const Pair& a, double b) {
  return {a.low * b, a.high * b};
}
FDI_INLINE Pair operator/(const Pair& a, double b) {
  return {a.low / b, a.high / b};
}
FDI_INLINE Pair& operator+=(Pair& a, const Pair& b) {
  return a = a + b;
}

FDI_INLINE PairMask operator<(const Pair& a, const Pair& b) {
  return {a.low < b.low, a.high < b.high};
}
FDI_INLINE PairMask operator>(const Pair& a, const Pair& b) {
  return b < a;
}
FDI_INLINE PairMask operator>=(const Pair& a, const Pair& b) {
  return {a.low >= b.low, a.high >= b.high};
}
FDI_INLINE PairMask operator!=(const Pair& a, const Pair& b) {
  return {a.low != b.low, a.high != b.high};
}
FDI_INLINE PairMask operator|(const PairMask& a, const PairMask& b) {
  return {a.low | b.low, a.high | b.high};
}
FDI_INLINE PairMask operator&(const PairMask& a, const PairMask& b) {
  return {a.low & b.low, a.high & b.high};
}

/// a where the mask holds, else b.
FDI_INLINE Wide Select(const WideMask& mask, const Wide& a, const Wide& b) {
  return mask ? a : b;
}
FDI_INLINE Pair Select(const PairMask& mask, const Pair& a, const Pair& b) {
  return {mask.low ? a.low : b.low, mask.high ? a.high : b.high};
}

template <typename Mask>
FDI_INLINE bool Any(const Mask& mask) {
  return mask[0] || mask[1] || mask[2] || mask[3];
}

/// std::min, std::max and std::clamp of each lane, NaN included.
template <typename Lanes>
FDI_INLINE Lanes Min(const Lanes& a, const Lanes& b) {
  return Select(b < a, b, a);
}
template <typename Lanes>
FDI_INLINE Lanes Max(const Lanes& a, const Lanes& b) {
  return Select(a < b, b, a);
}
template <typename Lanes>
FDI_INLINE Lanes Clamp(const Lanes& value, const Lanes& low,
                       const Lanes& high) {
  return Select(value < low, low, Select(high < value, high, value));
}

/// function(x) of each lane.
template <typename Lanes, typename Function>
FDI_INLINE Lanes ByLane(const Lanes& x, const Function& function) {
  Quad quad;
  Store(x, quad);
  for (double& lane : quad.lane) {
    lane = function(lane);
  }
  return Load<Lanes>(quad);
}

/// |x|; −0 for −0.
template <typename Lanes>
FDI_INLINE Lanes Magnitude(const Lanes& x) {
  const Lanes zero = All<Lanes>(0.0);
  return Select(x < zero, zero - x, x);
}

/// Truncates `scaled` to k; gives k and 2^k.
template <typename Vector, typename Integers, typename HalfIntegers>
FDI_INLINE void PowerOfTwo(const Vector& scaled, Vector& k_real,
                           Vector& power) {
  const auto k = __builtin_convertvector(scaled, HalfIntegers);
  k_real = __builtin_convertvector(k, Vector);
  const Integers bits = (__builtin_convertvector(k, Integers) + 1023) << 52;
  std::memcpy(&power, &bits, sizeof power);
}
FDI_INLINE void PowerOfTwo(const Wide& scaled, Wide& k_real, Wide& power) {
  using Integers = std::int64_t __attribute__((vector_size(32)));
  using HalfIntegers = std::int32_t __attribute__((vector_size(16)));
  PowerOfTwo<Wide, Integers, HalfIntegers>(scaled, k_real, power);
}
FDI_INLINE void PowerOfTwo(const Pair& scaled, Pair& k_real, Pair& power) {
  using Integers = std::int64_t __attribute__((vector_size(16)));
  using HalfIntegers = std::int32_t __attribute__((vector_size(8)));
  PowerOfTwo<Pair::Half, Integers, HalfIntegers>(scaled.low, k_real.low,
                                                 power.low);
  PowerOfTwo<Pair::Half, Integers, HalfIntegers>(scaled.high, k_real.high,
                                                 power.high);
}

/// Exp(t) of each lane; −700 < t ≤ 0.
template <typename Lanes>
FDI_INLINE Lanes Exp(const Lanes& t) {
  Lanes k_real{};
  Lanes power{};
  PowerOfTwo(t * exponential::kLog2E - 0.5, k_real, power);
  return exponential::Series((t - k_real * exponential::kLn2High) -
                             k_real * exponential::kLn2Low) *
         power;
}

}  // namespace fdi::lanes
