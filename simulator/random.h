#pragma once

#include <cstdint>
#include <random>

#include "simulator/excitation.h"

namespace fdi::simulator {

/// Standard normal numbers that are reproducible with every standard library
/// (std::normal_distribution is not): mt19937_64 and Marsaglia's polar method.
class NormalSource {
 public:
  /// @param stream selects one of the independent streams of a seed.
  NormalSource(std::uint64_t seed, std::uint64_t stream);
  double operator()();

 private:
  double Uniform();

  std::mt19937_64 engine_;
  bool has_spare_{false};
  double spare_{0.0};
};

/// A realisation of a Disturbance; starts in its stationary distribution.
class DisturbanceProcess {
 public:
  DisturbanceProcess(const Disturbance& disturbance, NormalSource source);
  /// The next value; the first call is sample 0.
  double Next();

 private:
  Disturbance disturbance_;
  NormalSource source_;
  double value_{0.0};
  bool started_{false};
};

}  // namespace fdi::simulator
