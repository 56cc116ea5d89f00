#include "trainer/calibration.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/error.h"
#include "trainer/statistics.h"
#include "trainer/tail_fit.h"
#include "trainer/window_limits.h"

namespace fdi::trainer {
namespace {

// T1, P1 and P2 vary more from day to day, and with where the valve stays, than
// in the hours of a training: means over windows within so many deviations are
// normal, and single readings beyond the thresholds tell.
constexpr double kLeastMeanOfInput = 2.0;

constexpr double kCoreQuantile = 0.05;
constexpr double kSupportMargin = 1.0;  // standard deviations

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

bool IsInput(Signal signal) {
  return signal == Signal::kT1 || signal == Signal::kP1 ||
         signal == Signal::kP2;
}

// True if the normal model of the channel predicts an output of the valve from
// the command.
bool ReadsCommand(const ModelSet& models, std::size_t channel) {
  if (models.observers.empty() || IsInput(models.channels[channel].output)) {
    return false;
  }
  const TsModel& model = models.observers.front().channels[channel].model;
  return (RequiredSignals(model) & MaskOf(Signal::kCv)) != 0;
}

}  // namespace

std::vector<double> Joined(const ResidualSeries& series) {
  std::vector<double> joined;
  for (const std::vector<double>& one : series) {
    joined.insert(joined.end(), one.begin(), one.end());
  }
  return joined;
}

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

void FitThresholds(const std::vector<ResidualSeries>& residuals,
                   const std::vector<std::vector<int>>& windows,
                   double rate_per_hour, ModelSet& models,
                   const std::vector<ResidualSeries>& commands) {
  const std::size_t channels = models.channels.size();
  Require(residuals.size() == channels && windows.size() == channels &&
              (commands.empty() || commands.size() == channels),
          "there must be series of residuals and windows for every channel");
  std::size_t tests = 0;
  for (const std::vector<int>& lengths : windows) {
    tests += 2 + 3 * lengths.size();
  }
  const double share = rate_per_hour * models.sample_period_s /
                       (3600.0 * static_cast<double>(tests));
  for (std::size_t c = 0; c < channels; ++c) {
    ChannelSpec& channel = models.channels[c];
    const std::vector<double> joined = Joined(residuals[c]);
    const int separation = static_cast<int>(std::ceil(CorrelationTime(joined)));
    const auto level = [&](double sign) {
      const std::vector<double> series =
          Sustained(joined, sign, models.decision.detection_samples);
      const double floor = 1e-6 + std::sqrt(Variance(joined));
      return std::max(floor, FitTail(series, share, separation).level);
    };
    channel.upper_threshold = level(1.0);
    channel.lower_threshold = -level(-1.0);
    for (const int length : windows[c]) {
      auto limits = FitWindow(residuals[c],
                              commands.empty() ? ResidualSeries() : commands[c],
                              length, share, ReadsCommand(models, c));
      if (limits) {
        const double least =
            IsInput(channel.output)
                ? kLeastMeanOfInput * std::sqrt(Variance(joined))
                : 0.0;
        limits->upper_mean = std::max(limits->upper_mean, least);
        limits->lower_mean = std::min(limits->lower_mean, -least);
        channel.windows.push_back(*limits);
      }
    }
  }
  models.threshold_hours = static_cast<double>(Joined(residuals[0]).size()) *
                           models.sample_period_s / 3600.0;
  models.false_alarms_per_hour = rate_per_hour;
}

}  // namespace fdi::trainer
