#include "diagnosis/model/tail.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

constexpr double kShrinkage = 50.0;
constexpr double kUpperBound = 1.645;  // 95 % of a normal distribution
constexpr double kMaxShape = 0.3;
constexpr double kFlat = 1e-6;  // a shape that is none
constexpr double kTail = 0.05;

// P(N ≤ events) of a Poisson distribution of mean μ. Each term by its
// logarithm, because powers and factorials overflow.
double AtMost(int events, double mean) {
  double sum = 0.0;
  for (int k = 0; k <= events; ++k) {
    sum += std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
  }
  return sum;
}

}  // namespace

double ParetoTail::Beyond(double y) const {
  if (std::abs(shape) < kFlat) {
    return std::exp(-y / scale);
  }
  const double base = 1.0 + shape * y / scale;
  return base > 0.0 ? std::pow(base, -1.0 / shape) : 0.0;
}

// ξ = 2 − b0/(b0 − 2 b1),  σ = 2 b0 b1/(b0 − 2 b1) with b1 = E[z (1 − G(z))].
ParetoTail FitPareto(std::span<const double> excesses, double least_shape) {
  const auto n = static_cast<double>(excesses.size());
  double b0 = 0.0;
  double b1 = 0.0;
  for (std::size_t i = 0; i < excesses.size(); ++i) {
    const double rank = (static_cast<double>(i) + 0.65) / n;
    b0 += excesses[i] / n;
    b1 += excesses[i] * (1.0 - rank) / n;
  }
  const double difference = b0 - 2.0 * b1;
  const double raw = difference > 0.0 ? 2.0 - b0 / difference : 0.0;
  ParetoTail tail;
  tail.shape = std::clamp(raw * n / (n + kShrinkage), least_shape, kMaxShape);
  // σ keeps the mean excess σ/(1 − ξ), at its 95 % upper bound.
  tail.scale = b0 * (1.0 - tail.shape) * (1.0 + kUpperBound / std::sqrt(n));
  return tail;
}

double ProbabilityBound(double successes, double trials) {
  if (!(trials > 0.0)) {
    return 1.0;
  }
  constexpr double kSquare = kUpperBound * kUpperBound;
  const double p = successes / trials;
  const double spread =
      p * (1.0 - p) / trials + kSquare / (4.0 * trials * trials);
  return (p + kSquare / (2.0 * trials) + kUpperBound * std::sqrt(spread)) /
         (1.0 + kSquare / trials);
}

double PoissonAtLeast(int events, double mean) {
  return 1.0 - AtMost(events - 1, mean);
}

double PoissonBound(int events) {
  // AtMost() falls with the mean, so bisection finds where it passes 5 %. For
  // any number of events that is below 10 + 3 events.
  double low = 1e-6;
  double high = 10.0 + 3.0 * events;
  for (int i = 0; i < 100; ++i) {
    const double mean = 0.5 * (low + high);
    (AtMost(events, mean) > kTail ? low : high) = mean;
  }
  return high;
}

}  // namespace fdi
