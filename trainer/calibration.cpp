#include "trainer/calibration.h"

#include <algorithm>
#include <cmath>

#include "diagnosis/error.h"
#include "diagnosis/residual_windows.h"
#include "trainer/tail_fit.h"

namespace fdi::trainer {
namespace {

constexpr double kCoreQuantile = 0.05;
constexpr double kSupportMargin = 1.0;  // standard deviations
constexpr int kFewestWindows = 5;       // to fit limits to
constexpr int kFewestValues = 100;
// Under inputs unlike those of the training a model errs more: no limit on a
// mean is closer than this share of the deviation, none on the deviation closer
// than so many times it.
constexpr double kLeastMean = 0.5;
constexpr double kLeastDeviation = 1.4;
constexpr double kLeastActivityVariance = 1e-6;  // to tell a slope from

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

// What the windows of all series have seen, one entry per full window.
struct WindowHistory {
  std::vector<double> mean;
  std::vector<double> energy;    // log-deviation of the residual
  std::vector<double> activity;  // log-deviation of CV; empty without CV
};

WindowHistory SlideWindow(const ResidualSeries& residuals,
                          const ResidualSeries& commands, int length) {
  WindowHistory history;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    ResidualWindow window(length);
    ResidualWindow command(length);
    for (std::size_t k = 0; k < residuals[i].size(); ++k) {
      window.Push(residuals[i][k]);
      if (!commands.empty()) {
        command.Push(commands[i][k]);
      }
      if (window.full()) {
        history.mean.push_back(window.mean());
        history.energy.push_back(window.log_rms());
        if (!commands.empty()) {
          history.activity.push_back(command.log_rms());
        }
      }
    }
  }
  return history;
}

// Of the line of y over x, in [0, 1]: a residual grows with what causes it.
double Slope(std::span<const double> x, std::span<const double> y) {
  const double mean_x = Mean(x);
  const double mean_y = Mean(y);
  double covariance = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    covariance += (x[k] - mean_x) * (y[k] - mean_y);
  }
  const double variance = Variance(x) * static_cast<double>(x.size());
  return variance > kLeastActivityVariance * static_cast<double>(x.size())
             ? std::clamp(covariance / variance, 0.0, 1.0)
             : 0.0;
}

void FitActivity(WindowHistory& history, WindowLimits& limits) {
  if (history.activity.empty()) {
    return;
  }
  limits.activity_slope = Slope(history.activity, history.energy);
  std::vector<double> sorted = history.activity;
  std::sort(sorted.begin(), sorted.end());
  limits.log_activity = SortedQuantile(sorted, 0.5);
  for (std::size_t k = 0; k < history.energy.size(); ++k) {
    history.energy[k] -=
        limits.activity_slope *
        std::max(history.activity[k] - limits.log_activity, 0.0);
  }
}

void FitWindow(const ResidualSeries& residuals, const ResidualSeries& commands,
               int length, double share, ChannelSpec& channel) {
  WindowHistory history = SlideWindow(residuals, commands, length);
  if (static_cast<int>(history.mean.size()) <
      std::max(kFewestWindows * length, kFewestValues)) {
    return;
  }
  const auto level = [&](const std::vector<double>& values) {
    return FitTail(values, share, 2 * length).level;
  };
  WindowLimits limits;
  limits.length = length;
  FitActivity(history, limits);
  const double sd = std::sqrt(Variance(Joined(residuals))) + 1e-6;
  const double least = kLeastMean * sd;
  limits.upper_mean = std::max(level(history.mean), least);
  for (double& mean : history.mean) {
    mean = -mean;
  }
  limits.lower_mean = -std::max(level(history.mean), least);
  limits.upper_log_rms =
      std::max(level(history.energy), std::log(kLeastDeviation * sd));
  channel.windows.push_back(limits);
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
      FitWindow(residuals[c], commands.empty() ? ResidualSeries() : commands[c],
                length, share, channel);
    }
  }
  models.threshold_hours = static_cast<double>(Joined(residuals[0]).size()) *
                           models.sample_period_s / 3600.0;
  models.false_alarms_per_hour = rate_per_hour;
}

}  // namespace fdi::trainer
