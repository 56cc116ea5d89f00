#include "trainer/statistics.h"

#include <algorithm>
#include <cmath>

namespace fdi::trainer {

double Mean(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
  }
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

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

}  // namespace fdi::trainer
