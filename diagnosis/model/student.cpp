#include "diagnosis/model/student.h"

#include <cmath>

#include "base/error.h"

namespace fdi {

// Bisection of the distribution, F(t) = 1 − I_x(ν/2, 1/2)/2, integrated
// numerically by Simpson's rule over θ, t = sqrt(ν) tan θ.
double StudentQuantile(double p, double freedom) {
  Require(p > 0.0 && p < 1.0 && freedom >= 1.0,
          "Student's t needs 0 < p < 1 and at least one degree of freedom");
  if (p < 0.5) {
    return -StudentQuantile(1.0 - p, freedom);
  }
  // F(t) − 1/2 = c ∫ cos^(ν−1) θ dθ from 0 to atan(t/sqrt(ν))
  const double c = std::exp(std::lgamma(0.5 * (freedom + 1.0)) -
                            std::lgamma(0.5 * freedom)) /
                   std::sqrt(std::acos(-1.0));
  const auto area = [&](double end) {
    constexpr int kSteps = 64;
    const double h = end / kSteps;
    double sum = 0.0;
    for (int i = 0; i <= kSteps; ++i) {
      const double weight = i == 0 || i == kSteps ? 1.0
                            : i % 2 != 0          ? 4.0
                                                  : 2.0;
      sum += weight * std::pow(std::cos(i * h), freedom - 1.0);
    }
    return c * sum * h / 3.0;
  };
  double low = 0.0;
  double high = 0.5 * std::acos(-1.0);
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (area(middle) < p - 0.5 ? low : high) = middle;
  }
  return std::sqrt(freedom) * std::tan(low);
}

}  // namespace fdi
