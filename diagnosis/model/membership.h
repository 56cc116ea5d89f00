#pragma once

#include <algorithm>

namespace fdi {

/// Trapezoidal membership: 0 outside [a, d], 1 on [b, c], linear between.
struct Trapezoid {
  double a{0.0};
  double b{0.0};
  double c{0.0};
  double d{0.0};

  double operator()(double value) const {
    if (value < b) {
      return value <= a ? 0.0 : (value - a) / (b - a);
    }
    if (value > c) {
      return value >= d ? 0.0 : (d - value) / (d - c);
    }
    return 1.0;
  }
};

}  // namespace fdi
