#include "trainer/calibration.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/error.h"
#include "trainer/tail_fit.h"

namespace fdi::trainer {
namespace {

constexpr double kCoreQuantile = 0.05;
constexpr double kSupportMargin = 1.0;  // standard deviations

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

double SortedQuantile(const std::vector<double>& sorted, double q) {
  const double at = q * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] +
         (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

// min of n_d consecutive values: what a detection needs to be beyond.
std::vector<double> Sustained(const std::vector<double>& series, double sign,
                              int samples) {
  std::vector<double> sustained;
  const auto n = static_cast<std::size_t>(samples);
  for (std::size_t k = n - 1; k < series.size(); ++k) {
    double lowest = sign * series[k];
    for (std::size_t j = 1; j < n; ++j) {
      lowest = std::min(lowest, sign * series[k - j]);
    }
    sustained.push_back(lowest);
  }
  return sustained;
}

}  // namespace

ValidationFigures Figures(std::span<const double> residuals,
                          std::span<const double> outputs) {
  Require(residuals.size() == outputs.size(),
          "residuals and outputs must be of one length");
  ValidationFigures figures;
  figures.samples = static_cast<std::int64_t>(residuals.size());
  figures.bias = Mean(residuals);
  const double variance = Variance(residuals);
  figures.mse = variance + figures.bias * figures.bias;
  const double total = Variance(outputs);
  figures.vaf = total > 0.0 ? 100.0 * (1.0 - variance / total) : 0.0;
  return figures;
}

Trapezoid FitMembership(std::span<const double> residuals) {
  Require(!residuals.empty(), "a membership needs residuals");
  std::vector<double> sorted(residuals.begin(), residuals.end());
  std::sort(sorted.begin(), sorted.end());
  const double margin =
      std::max(kSupportMargin * std::sqrt(Variance(residuals)), 1e-9);
  Trapezoid membership;
  membership.b = std::min(SortedQuantile(sorted, kCoreQuantile), 0.0);
  membership.c = std::max(SortedQuantile(sorted, 1.0 - kCoreQuantile), 0.0);
  membership.a = std::min(sorted.front(), membership.b) - margin;
  membership.d = std::max(sorted.back(), membership.c) + margin;
  return membership;
}

double CorrelationTime(std::span<const double> residuals) {
  const double mean = Mean(residuals);
  const double variance = Variance(residuals);
  double time = 1.0;
  const std::size_t longest = std::min<std::size_t>(200, residuals.size() / 4);
  for (std::size_t lag = 1; lag <= longest && variance > 0.0; ++lag) {
    double sum = 0.0;
    for (std::size_t k = lag; k < residuals.size(); ++k) {
      sum += (residuals[k] - mean) * (residuals[k - lag] - mean);
    }
    const double rho = sum / (variance * static_cast<double>(residuals.size()));
    if (rho < 0.05) {
      break;
    }
    time += 2.0 * rho;
  }
  return time;
}

void FitThresholds(const std::vector<std::vector<double>>& residuals,
                   double rate_per_hour, ModelSet& models) {
  Require(residuals.size() == models.channels.size(),
          "there must be one series of residuals per channel");
  const double per_sample = rate_per_hour * models.sample_period_s / 3600.0;
  const double share =
      per_sample / (2.0 * static_cast<double>(models.channels.size()));
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const int separation =
        static_cast<int>(std::ceil(CorrelationTime(residuals[c])));
    const auto level = [&](double sign) {
      const std::vector<double> series =
          Sustained(residuals[c], sign, models.decision.detection_samples);
      const double floor = 1e-6 + std::sqrt(Variance(residuals[c]));
      return std::max(floor, FitTail(series, share, separation).level);
    };
    models.channels[c].upper_threshold = level(1.0);
    models.channels[c].lower_threshold = -level(-1.0);
  }
  models.threshold_hours = static_cast<double>(residuals.front().size()) *
                           models.sample_period_s / 3600.0;
  models.false_alarms_per_hour = rate_per_hour;
}

}  // namespace fdi::trainer
