#include "trainer/sign_test.h"

#include <algorithm>
#include <cmath>

namespace fdi::trainer {

SignTest CountSigns(const std::vector<double>& differences) {
  SignTest test;
  for (const double difference : differences) {
    test.positive += difference > 0.0;
    test.negative += difference < 0.0;
    test.ties += difference == 0.0;
  }
  return test;
}

double PValue(const SignTest& test) {
  const int n = test.decided();
  const int least = std::min(test.positive, test.negative);
  // Term i of the sum in logarithms: 2⁻ⁿ underflows beyond a thousand pairs.
  double sum = 0.0;
  for (int i = 0; i <= least; ++i) {
    sum += std::exp(std::lgamma(n + 1.0) - std::lgamma(i + 1.0) -
                    std::lgamma(n - i + 1.0) - n * std::log(2.0));
  }
  return std::min(1.0, 2.0 * sum);
}

}  // namespace fdi::trainer
