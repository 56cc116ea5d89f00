#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace fdi {

/// The median of one value or more; with an even number, the greater of the two
/// in the middle.
template <typename T>
T Median(std::vector<T> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The standard deviation of a normal distribution whose median absolute
/// deviation is that of `deviations`, one or more, of either sign.
inline double RobustSd(std::vector<double> deviations) {
  for (double& deviation : deviations) {
    deviation = std::abs(deviation);
  }
  return 1.4826 * Median(std::move(deviations));
}

}  // namespace fdi
