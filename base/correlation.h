#pragma once

#include <cmath>

namespace fdi {

/// Pearson's correlation coefficient of pairs.
struct CorrelationSums {
  double n{0.0};
  double x{0.0};
  double y{0.0};
  double xx{0.0};
  double yy{0.0};
  double xy{0.0};

  void Add(double u, double v) {
    n += 1.0;
    x += u;
    y += v;
    xx += u * u;
    yy += v * v;
    xy += u * v;
  }
  /// 0 if one of the two is constant.
  double Correlation() const {
    const double spread = (n * xx - x * x) * (n * yy - y * y);
    return spread > 0.0 ? (n * xy - x * y) / std::sqrt(spread) : 0.0;
  }
};

}  // namespace fdi
