#include "trainer/tail_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/error.h"

namespace fdi::trainer {
namespace {

constexpr double kTailQuantile = 0.95;
constexpr double kShrinkage = 50.0;
constexpr double kUpperBound = 1.645;  // 95 % of a normal distribution
constexpr double kLowestShape = -0.1;
constexpr double kHighestShape = 0.3;

double Quantile(std::vector<double> values, double q) {
  const auto at =
      static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// Largest excess over u of every cluster, in ascending order.
std::vector<double> ClusterMaxima(std::span<const double> series, double u,
                                  int separation) {
  std::vector<double> maxima;
  std::size_t last = 0;
  for (std::size_t k = 0; k < series.size(); ++k) {
    if (!(series[k] > u)) {
      continue;
    }
    const double excess = series[k] - u;
    if (!maxima.empty() && k - last < static_cast<std::size_t>(separation)) {
      maxima.back() = std::max(maxima.back(), excess);
    } else {
      maxima.push_back(excess);
    }
    last = k;
  }
  std::sort(maxima.begin(), maxima.end());
  return maxima;
}

// ξ = 2 − b0/(b0 − 2 b1),  σ = 2 b0 b1/(b0 − 2 b1) with b1 = E[z (1 − G(z))].
void FitPareto(const std::vector<double>& maxima, TailThreshold& tail) {
  const auto n = static_cast<double>(maxima.size());
  double b0 = 0.0;
  double b1 = 0.0;
  for (std::size_t i = 0; i < maxima.size(); ++i) {
    const double rank = (static_cast<double>(i) + 0.65) / n;
    b0 += maxima[i] / n;
    b1 += maxima[i] * (1.0 - rank) / n;
  }
  const double difference = b0 - 2.0 * b1;
  const double raw = difference > 0.0 ? 2.0 - b0 / difference : 0.0;
  tail.shape =
      std::clamp(raw * n / (n + kShrinkage), kLowestShape, kHighestShape);
  // σ keeps the mean excess σ/(1 − ξ), at its 95 % upper bound.
  tail.scale = b0 * (1.0 - tail.shape) * (1.0 + kUpperBound / std::sqrt(n));
}

}  // namespace

TailThreshold FitTail(std::span<const double> series, double rate,
                      int separation) {
  Require(series.size() >= 100, "a tail needs at least 100 values");
  Require(rate > 0.0 && rate <= 0.01, "the rate must be in (0, 0.01]");
  Require(separation >= 1, "the separation must be at least 1 sample");
  TailThreshold tail;
  tail.base = Quantile({series.begin(), series.end()}, kTailQuantile);
  const std::vector<double> maxima =
      ClusterMaxima(series, tail.base, separation);
  tail.clusters = static_cast<int>(maxima.size());
  if (maxima.empty()) {  // a series that never exceeds its own quantile
    tail.level = tail.base;
    return tail;
  }
  FitPareto(maxima, tail);
  const double n = tail.clusters;
  const double base_rate = n / static_cast<double>(series.size());
  const double ratio = base_rate / rate;
  const double reach = std::abs(tail.shape) < 1e-6
                           ? std::log(ratio)
                           : (std::pow(ratio, tail.shape) - 1.0) / tail.shape;
  // No data of some hours support a level that they themselves exceed.
  tail.level = tail.base + std::max(tail.scale * std::max(0.0, reach),
                                    maxima.back() + tail.scale);
  return tail;
}

}  // namespace fdi::trainer
