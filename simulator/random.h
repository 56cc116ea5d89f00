#pragma once

#include <cstdint>
#include <random>

#include "simulator/excitation.h"

namespace fdi::simulator {

/// Standard normal numbers, the same for the same seed on every standard
/// library (std::normal_distribution is not): mt19937_64 and the polar method
/// of Marsaglia.
class NormalSource {
 public:
  /// @param stream Independent streams of one seed.
  NormalSource(std::uint64_t seed, std::uint64_t stream);
  double operator()();

 private:
  double Uniform();

  std::mt19937_64 engine_;
  bool has_spare_{false};
  double spare_{0.0};
};

/// A Disturbance as it runs; starts in its stationary distribution.
class DisturbanceProcess {
 public:
  DisturbanceProcess(const Disturbance& disturbance, NormalSource source);
  /// The next value; the first call gives sample 0.
  double Next();

 private:
  Disturbance disturbance_;
  NormalSource source_;
  double value_{0.0};
  bool started_{false};
};

}  // namespace fdi::simulator
