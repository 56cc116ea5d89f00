#include "base/usual_period.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fdi {

double ShorterMedian(std::vector<double> steps) {
  if (steps.empty()) {
    return 0.0;
  }
  const auto middle =
      steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

double UsualPeriod(double period_s) {
  for (const double usual : {0.1, 0.2, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0,
                             10.0, 12.0, 15.0, 20.0, 30.0, 60.0, 120.0}) {
    if (std::abs(period_s - usual) < 0.05 * usual) {
      return usual;
    }
  }
  return period_s;
}

}  // namespace fdi
