#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

namespace fdi {

/// exp(t) for t ≤ 0: t = k ln 2 + r, |r| ≤ ln(2)/2, times the Taylor series of
/// exp(r) up to r¹³. Relative error below 3e-16. The library's exp differs in
/// the last bit between machines with and without fused multiply-add.
namespace exponential {

/// exp(t) is 0 below this, which is far above the subnormal range.
inline constexpr double kLowest = -700.0;
inline constexpr double kLog2E = 1.4426950408889634;
inline constexpr double kLn2High = 6.93147180369123816490e-01;
inline constexpr double kLn2Low = 1.90821492927058770002e-10;
inline constexpr std::array<double, 14> kInverseFactorial = {1.0 / 6227020800.0,
                                                             1.0 / 479001600.0,
                                                             1.0 / 39916800.0,
                                                             1.0 / 3628800.0,
                                                             1.0 / 362880.0,
                                                             1.0 / 40320.0,
                                                             1.0 / 5040.0,
                                                             1.0 / 720.0,
                                                             1.0 / 120.0,
                                                             1.0 / 24.0,
                                                             1.0 / 6.0,
                                                             0.5,
                                                             1.0,
                                                             1.0};

/// Horner's scheme for exp(r); T is a number or several side by side.
template <typename T>
[[gnu::always_inline]] inline T Series(const T& r) {
  T series = r * kInverseFactorial[0] + kInverseFactorial[1];
  for (std::size_t i = 2; i < kInverseFactorial.size(); ++i) {
    series = series * r + kInverseFactorial[i];
  }
  return series;
}

}  // namespace exponential

inline double Exp(double t) {
  if (!(t > exponential::kLowest)) {
    return 0.0;
  }
  const auto k = static_cast<std::int64_t>(t * exponential::kLog2E - 0.5);
  const auto k_real = static_cast<double>(k);
  const double r =
      (t - k_real * exponential::kLn2High) - k_real * exponential::kLn2Low;
  const auto bits = static_cast<std::uint64_t>(k + 1023) << 52U;
  return exponential::Series(r) * std::bit_cast<double>(bits);
}

}  // namespace fdi
