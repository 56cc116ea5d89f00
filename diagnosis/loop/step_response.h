#pragma once

#include <span>

namespace fdi::loop {

/// The answer of a rod to a step of its command. Times in samples from the
/// first one with the new command, interpolated: good to a sample.
struct StepResponse {
  double realised{0.0};   ///< x_∞ − x_0, as x.
  double delay{0.0};      ///< Td: until 2 % of it.
  double t63{0.0};        ///< T63: until 63.2 % of it.
  double t86{0.0};        ///< T86: until 86.5 % of it.
  double overshoot{0.0};  ///< Largest excess, in shares of it.
};

/// @param x     from the first sample with the new command on; not empty.
/// @param begin x_0, before the step. x_∞ is the mean of the last quarter of x.
///
/// Source: ISA-75.25.01 (times of the realised step).
StepResponse ResponseOf(std::span<const float> x, double begin);

}  // namespace fdi::loop
