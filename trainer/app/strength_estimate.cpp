#include "trainer/app/strength_estimate.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/fault_catalogue.h"
#include "trainer/app/rescore.h"

namespace fdi::trainer {
namespace {

constexpr double kHalfGrid = 0.025;  // Of the strengths of conditions.

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

// Of the later half: the first one is the search.
double LaterMedian(const std::vector<double>& values) {
  std::vector<double> later(
      values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
      values.end());
  const auto middle =
      later.begin() + static_cast<std::ptrdiff_t>(later.size() / 2);
  std::nth_element(later.begin(), middle, later.end());
  return *middle;
}

// The largest strength that the fault was trained at, in the direction of
// `sign`.
double LargestTrained(const ModelSet& models, int fault, double sign) {
  double largest = 0.0;
  for (const Observer& observer : models.observers) {
    if (observer.fault == fault && observer.strength * sign > 0.0) {
      largest = std::max(largest, std::abs(observer.strength));
    }
  }
  return largest;
}

}  // namespace

StrengthEstimate EstimateStrength(const std::shared_ptr<const ModelSet>& models,
                                  const storage::StoredRun& run, int fault,
                                  std::int64_t detected_ns) {
  const std::string set = models->name + "@" + std::to_string(models->version);
  const int index = FaultIndex(*models, fault);
  if (index < 0) {
    return {0.0, set + " does not know " + FaultName(fault)};
  }
  std::vector<double> strengths;
  std::vector<double> factors;
  Rescore(models, run, [&](const Sample& sample, const Verdict& verdict) {
    if (verdict.detected && sample.stamp_ns >= detected_ns) {
      const auto f = static_cast<std::size_t>(index);
      strengths.push_back(verdict.strengths[f]);
      factors.push_back(verdict.fault_factors[f]);
    }
  });
  if (strengths.empty()) {
    return {0.0, set + " detects nothing here"};
  }
  const double strength = LaterMedian(strengths);
  const double factor = LaterMedian(factors);
  const double least = 0.5 * models->decision.isolation_threshold;
  if (factor < least || strength == 0.0) {
    return {0.0, set + " gives " + FaultName(fault) + " a factor of " +
                     Number(factor) + ", needed is " + Number(least)};
  }
  const double largest = LargestTrained(*models, fault, strength);
  if (std::abs(strength) > largest + kHalfGrid) {
    return {0.0, set + " estimates " + Number(strength) +
                     ", beyond what it was trained at (" + Number(largest) +
                     ")"};
  }
  return {strength, {}};
}

}  // namespace fdi::trainer
