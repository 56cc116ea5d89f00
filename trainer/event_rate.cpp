#include "trainer/event_rate.h"

#include <cmath>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

constexpr double kTail = 0.05;

// P(N ≤ events) of a Poisson distribution of mean μ.
double AtMost(int events, double mean) {
  double sum = 0.0;
  for (int k = 0; k <= events; ++k) {
    sum += std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
  }
  return sum;
}

}  // namespace

EventRate RateOf(int events, double hours) {
  Require(events >= 0 && hours > 0.0,
          "a rate needs a number of events and a time");
  double low = 1e-6;
  double high = 10.0 + 3.0 * events;
  for (int i = 0; i < 100; ++i) {
    const double mean = 0.5 * (low + high);
    (AtMost(events, mean) > kTail ? low : high) = mean;
  }
  return {events / hours * kHoursPerYear, high / hours * kHoursPerYear};
}

}  // namespace fdi::trainer
