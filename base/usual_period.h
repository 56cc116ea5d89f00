#pragma once

#include <vector>

namespace fdi {

/// Median of `steps`, the shorter one if two are in the middle: a gap must not
/// become the period of a short record. 0 if there are none.
double ShorterMedian(std::vector<double> steps);

/// The round sample period within 5 % of `period_s` [s], else `period_s`:
/// jitter blurs a measured step.
double UsualPeriod(double period_s);

}  // namespace fdi
