#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>
#include <vector>

namespace fdi::loop {

/// Largest − smallest value. @param values not empty.
inline double RangeOf(std::span<const double> values) {
  const auto [low, high] = std::ranges::minmax_element(values);
  return *high - *low;
}

/// @param values not empty.
inline double Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

/// The output of a play (backlash) of width w for the input u:
///
///     p_k = min(max(p_{k-1}, u_k - w/2), u_k + w/2),   p_{-1} = `start`.
inline std::vector<double> PlayOf(std::span<const double> input, double width,
                                  double start) {
  std::vector<double> output(input.size());
  double p = start;
  for (std::size_t k = 0; k < input.size(); ++k) {
    p = std::clamp(p, input[k] - 0.5 * width, input[k] + 0.5 * width);
    output[k] = p;
  }
  return output;
}

}  // namespace fdi::loop
