#include "trainer/window_limits.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "diagnosis/residual_windows.h"
#include "trainer/statistics.h"
#include "trainer/tail_fit.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kFewestValues = 100;
constexpr int kFewClusters = 10;      // too few for a tail of their own
constexpr int kSomeClusters = 30;     // too few for their tail to be trusted
constexpr double kSeenMean = 1.5;     // times what the record showed
constexpr double kSeenLogRms = 0.25;  // more than what the record showed
constexpr double kMargin = 1.25;      // on what correlation makes plausible
constexpr double kCommandedDrift = 0.75;  // deviations
constexpr double kLeastMean = 0.5;        // deviations
constexpr double kLeastDeviation = 1.4;
constexpr double kCommandMargin = 0.5;           // of the range
constexpr double kLeastCommandMargin = 2.0;      // %
constexpr double kLeastActivityVariance = 1e-6;  // to tell a slope from

// What the windows of all series have seen, one entry per full window.
struct WindowHistory {
  std::vector<double> mean;
  std::vector<double> energy;    // log-deviation of the residual
  std::vector<double> activity;  // log-deviation of CV; empty without CV
  std::vector<double> command;   // mean of CV; likewise
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
          history.command.push_back(command.mean());
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
  const auto [lowest, highest] =
      std::minmax_element(history.command.begin(), history.command.end());
  const double margin =
      std::max(kCommandMargin * (*highest - *lowest), kLeastCommandMargin);
  limits.command = {*lowest - margin, *highest + margin};
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

// z with P(Z > z) = share of a standard normal distribution, by bisection.
double NormalQuantile(double share) {
  double low = 0.0;
  double high = 40.0;
  for (int i = 0; i < 60; ++i) {
    const double z = 0.5 * (low + high);
    (0.5 * std::erfc(z / std::numbers::sqrt2) > share ? low : high) = z;
  }
  return high;
}

// The limits that short-range correlation makes plausible.
struct Plausible {
  double mean;
  double log_rms;
};

Plausible ByCorrelation(const std::vector<double>& residuals, int length,
                        double share) {
  const double sd = std::sqrt(Variance(residuals)) + 1e-6;
  std::vector<double> squares;
  for (const double r : residuals) {
    squares.push_back(r * r / (sd * sd));
  }
  const double z = NormalQuantile(share);
  const double samples = 2.0 * length;
  const double kappa = Variance(squares);
  return {kMargin * z * sd * std::sqrt(CorrelationTime(residuals) / samples),
          std::log(kMargin * sd) +
              0.5 * z * std::sqrt(kappa * CorrelationTime(squares) / samples)};
}

// @param bound What to take if the tail is not known, or poorly.
double Level(const std::vector<double>& values, double share, int length,
             double bound) {
  const TailThreshold tail = FitTail(values, share, 2 * length);
  if (tail.clusters < kFewClusters) {
    return bound;
  }
  return tail.clusters < kSomeClusters ? std::min(tail.level, bound)
                                       : tail.level;
}

}  // namespace

std::optional<WindowLimits> FitWindow(const ResidualSeries& residuals,
                                      const ResidualSeries& commands,
                                      int length, double share,
                                      bool commanded) {
  WindowHistory history = SlideWindow(residuals, commands, length);
  if (history.mean.size() < kFewestValues) {
    return std::nullopt;
  }
  WindowLimits limits;
  limits.length = length;
  FitActivity(history, limits);
  const std::vector<double> joined = Joined(residuals);
  const double sd = std::sqrt(Variance(joined)) + 1e-6;
  const Plausible plausible = ByCorrelation(joined, length, share);
  const auto mean_level = [&] {
    const double seen =
        *std::max_element(history.mean.begin(), history.mean.end());
    const double drift = commanded ? kCommandedDrift * sd : 0.0;
    return std::max(Level(history.mean, share, length,
                          std::max({plausible.mean, kSeenMean * seen, drift})),
                    kLeastMean * sd);
  };
  limits.upper_mean = mean_level();
  for (double& mean : history.mean) {
    mean = -mean;
  }
  limits.lower_mean = -mean_level();
  const double seen =
      *std::max_element(history.energy.begin(), history.energy.end());
  limits.upper_log_rms =
      std::max(Level(history.energy, share, length,
                     std::max(plausible.log_rms, seen + kSeenLogRms)),
               std::log(kLeastDeviation * sd));
  return limits;
}

}  // namespace fdi::trainer
