#include "bench/study/wilson_interval.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace fdi::trainer::study {

Interval WilsonInterval(int successes, int trials) {
  Require(successes >= 0 && successes <= trials,
          "successes must be within the trials");
  if (trials == 0) {
    return {};
  }
  constexpr double kZ = 1.959963984540054;
  const double n = trials;
  const double p = successes / n;
  const double z2n = kZ * kZ / n;
  const double middle = p + z2n / 2.0;
  const double half = kZ * std::sqrt(p * (1.0 - p) / n + z2n / (4.0 * n));
  return {std::max(0.0, (middle - half) / (1.0 + z2n)),
          std::min(1.0, (middle + half) / (1.0 + z2n))};
}

}  // namespace fdi::trainer::study
