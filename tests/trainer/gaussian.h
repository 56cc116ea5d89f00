#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

namespace fdi::trainer {

/// Independent standard normal values, the same on every platform.
inline std::vector<double> GaussianSeries(std::size_t count,
                                          std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto uniform = [&] {
    return (static_cast<double>(engine() >> 11) + 0.5) * 0x1p-53;
  };
  std::vector<double> series(count);
  for (double& value : series) {
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    value = radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  return series;
}

}  // namespace fdi::trainer
