#include "trainer/statistics.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "diagnosis/model/tail.h"

namespace fdi::trainer {
double Mean(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
  }
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

// In a second pass, about the mean: the difference of two sums of squares would
// lose the digits of a small variance beside a large mean.
double Variance(std::span<const double> values) {
  const double mean = Mean(values);
  double sum = 0.0;
  for (const double value : values) {
    sum += (value - mean) * (value - mean);
  }
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

double MeanSquare(std::span<const double> values) {
  double sum = 0.0;
  double count = 0.0;
  for (const double value : values) {
    sum += std::isnan(value) ? 0.0 : value * value;
    count += std::isnan(value) ? 0.0 : 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

double SortedQuantile(const std::vector<double>& sorted, double q) {
  const double at = q * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] +
         (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

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

EventRate RateOf(int events, double hours) {
  Require(events >= 0 && hours > 0.0,
          "a rate needs a number of events and a time");
  return {events / hours * kHoursPerYear,
          PoissonBound(events) / hours * kHoursPerYear};
}

}  // namespace fdi::trainer
