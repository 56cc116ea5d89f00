#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace fdi {

/// The median of one value or more; of an even number, the greater of the two
/// in the middle.
template <typename T>
T Median(std::vector<T> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace fdi
