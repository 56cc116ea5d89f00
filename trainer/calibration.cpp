#include "trainer/calibration.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/student.h"
#include "diagnosis/model/tail.h"
#include "diagnosis/observers/residual_windows.h"
#include "trainer/rule_text.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kTailQuantile = 0.95;
constexpr double kMinShape = -0.1;
constexpr double kMaxRate = 0.01;  // per sample; more is no tail any more

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

}  // namespace

TailThreshold FitTail(std::span<const double> series, double rate,
                      int separation) {
  Require(series.size() >= 100, "a tail needs at least 100 values");
  Require(rate > 0.0 && rate <= kMaxRate, "the rate must be in (0, 0.01]");
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
  const ParetoTail pareto = FitPareto(maxima, kMinShape);
  tail.scale = pareto.scale;
  tail.shape = pareto.shape;
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

namespace {

constexpr std::size_t kMinValues = 100;
constexpr int kFewClusters = 10;      // too few for a tail of their own
constexpr int kSomeClusters = 30;     // too few for their tail to be trusted
constexpr double kSeenMean = 1.5;     // times what the record showed
constexpr double kSeenLogRms = 0.25;  // more than what the record showed
constexpr double kMargin = 1.25;      // on what correlation makes plausible
constexpr double kCommandedDrift = 0.75;  // deviations
constexpr double kMinMean = 0.5;          // deviations
constexpr double kMinRms = 1.4;
constexpr double kCommandMargin = 0.5;         // of the range
constexpr double kMinCommandMargin = 2.0;      // %
constexpr double kMinActivityVariance = 1e-6;  // to tell a slope from

// Values that the windows of all series have seen, one entry per full window.
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

// Slope of the line of y over x, in [0, 1]: a residual grows with its cause.
double Slope(std::span<const double> x, std::span<const double> y) {
  const double mean_x = Mean(x);
  const double mean_y = Mean(y);
  double covariance = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    covariance += (x[k] - mean_x) * (y[k] - mean_y);
  }
  const double variance = Variance(x) * static_cast<double>(x.size());
  return variance > kMinActivityVariance * static_cast<double>(x.size())
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
      std::max(kCommandMargin * (*highest - *lowest), kMinCommandMargin);
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
  // A mean varies no more than what it is taken of, however slow that is.
  const double share_of_mean =
      std::min(1.0, CorrelationTime(residuals) / samples);
  return {kMargin * z * sd * std::sqrt(share_of_mean),
          std::log(kMargin * sd) +
              0.5 * z * std::sqrt(kappa * CorrelationTime(squares) / samples)};
}

// Whole blocks, as near to that length as a series divides into; of one that is
// shorter than half of it, none.
std::vector<std::span<const double>> Blocks(const std::vector<double>& series,
                                            std::size_t block) {
  std::vector<std::span<const double>> blocks;
  const std::size_t parts = (series.size() + block / 2) / block;
  for (std::size_t i = 0; i < parts; ++i) {
    const std::size_t from = i * series.size() / parts;
    const std::size_t to = (i + 1) * series.size() / parts;
    blocks.push_back(std::span(series).subspan(from, to - from));
  }
  return blocks;
}

std::vector<double> WithoutBlockMeans(const ResidualSeries& residuals,
                                      std::size_t block) {
  std::vector<double> fast;
  for (const std::vector<double>& series : residuals) {
    std::vector<std::span<const double>> blocks = Blocks(series, block);
    if (blocks.empty()) {
      blocks.emplace_back(series);
    }
    for (const std::span<const double> one : blocks) {
      const double mean = Mean(one);
      for (const double residual : one) {
        fast.push_back(residual - mean);
      }
    }
  }
  return fast;
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

// Limits on the windows of N samples over the normal residuals, each exceeded
// by `share` of the samples.
//
// They come from the tail of the windows (FitTail). Where the record holds
// fewer than 30 independent excesses, as some hours do of a window of minutes,
// that tail is mostly its own uncertainty; then what short-range correlation
// makes of a window is an upper bound, and stands alone below 10,
//
//     |mean| ≤ 1.25 z σ √min(1, τ/2N),   log rms ≤ ln 1.25 σ + z/2 √(κ τ₂/2N),
//
// z the Gaussian quantile of `share`, τ and τ₂ the correlation times of the
// residual and its square, κ the variance of r²/σ²; but never less than the
// record itself showed, times 1.5 (mean) or e^0.25 (rms). Under inputs unlike
// those of the training a model errs more: no limit on a mean is closer than
// half a deviation, none on the deviation closer than 1.4 times it.
//
// The limit on the energy follows the activity of CV, see FitThresholds(). All
// limits hold for means of CV over the window as in the record, and half their
// range beyond, 2 % at least.
//
// @param commanded The model reads CV: what it errs by hangs on how the loop
//   moves. The mean of a short record is given 0.75 deviations. σ and τ are
//   those of its fast part, without the means of blocks: the slow part is
//   allowed for by itself (SlowAllowance()), and would count twice.
// @param commands CV at the samples of the residuals; empty: no slope.
// @return Nothing if there are fewer than 100 full windows.
std::optional<WindowLimits> FitWindowLimits(const ResidualSeries& residuals,
                                            const ResidualSeries& commands,
                                            int length, double share,
                                            bool commanded, std::size_t block) {
  WindowHistory history = SlideWindow(residuals, commands, length);
  if (history.mean.size() < kMinValues) {
    return std::nullopt;
  }
  WindowLimits limits;
  limits.length = length;
  FitActivity(history, limits);
  const std::vector<double> joined = Joined(residuals);
  const double sd = std::sqrt(Variance(joined)) + 1e-6;
  const Plausible plausible = ByCorrelation(
      commanded ? WithoutBlockMeans(residuals, block) : joined, length, share);
  const auto mean_level = [&] {
    const double seen =
        *std::max_element(history.mean.begin(), history.mean.end());
    const double drift = commanded ? kCommandedDrift * sd : 0.0;
    return std::max(Level(history.mean, share, length,
                          std::max({plausible.mean, kSeenMean * seen, drift})),
                    kMinMean * sd);
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
               std::log(kMinRms * sd));
  return limits;
}

// T1, P1 and P2 vary more from day to day, and with where the valve stays, than
// in the hours of a training: means over windows within so many deviations are
// normal, and single readings beyond the thresholds tell.
constexpr double kMinMeanOfInput = 2.0;

constexpr double kBlockS = 600.0;     // of the slow part
constexpr double kBlockRows = 600.0;  // of slow data: beyond all windows
constexpr double kPriorDays = 4.0;    // ν₀
constexpr double kOutputStray = 0.2;  // κ, deviations
constexpr double kInputStray = 1.0;
constexpr double kMaxSlowShare = 0.05;

constexpr double kCoreQuantile = 0.05;
constexpr double kSupportMargin = 1.0;  // standard deviations

// A detection needs more than this: the least of n_d values in a row.
std::vector<double> SustainedOf(const std::vector<double>& series, double sign,
                                int samples) {
  fdi::Sustained last(samples);
  std::vector<double> least;
  for (std::size_t k = 0; k < series.size(); ++k) {
    const double value = last.Push(sign * series[k]);
    if (k + 1 >= static_cast<std::size_t>(samples)) {
      least.push_back(value);
    }
  }
  return least;
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

double SlowAllowance(const ResidualSeries& residuals, std::size_t block,
                     double kappa, double share) {
  std::vector<double> means;
  for (const std::vector<double>& series : residuals) {
    for (const std::span<const double> one : Blocks(series, block)) {
      means.push_back(Mean(one));
    }
  }
  const double blocks = std::max(static_cast<double>(means.size()), 1.0);
  const double stray = kappa * std::sqrt(Variance(Joined(residuals)));
  const double freedom = kPriorDays + blocks - 1.0;
  const double variance =
      (kPriorDays * stray * stray + blocks * Variance(means)) / freedom;
  return StudentQuantile(1.0 - std::min(share, kMaxSlowShare), freedom) *
         std::sqrt(variance * (1.0 + 1.0 / blocks));
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
  if (share > kMaxRate) {
    throw ConfigError("false alarms per hour are " + Digits(rate_per_hour, 4) +
                      ", accepted are up to " +
                      Digits(rate_per_hour * kMaxRate / share, 4) + " for " +
                      std::to_string(tests) + " tests and a sample period of " +
                      Digits(models.sample_period_s, 4) + " s");
  }
  const auto block = static_cast<std::size_t>(
      std::max(kBlockRows, kBlockS / models.sample_period_s));
  const double day = 24.0 * rate_per_hour / static_cast<double>(tests);
  for (std::size_t c = 0; c < channels; ++c) {
    ChannelSpec& channel = models.channels[c];
    const std::vector<double> joined = Joined(residuals[c]);
    const double slow = SlowAllowance(
        residuals[c], block,
        IsInput(channel.output) ? kInputStray : kOutputStray, day);
    const int separation = static_cast<int>(std::ceil(CorrelationTime(joined)));
    const auto level = [&](double sign) {
      const std::vector<double> series =
          SustainedOf(joined, sign, models.decision.detection_samples);
      if (series.size() < kMinValues) {
        throw DataError(
            "channel " + channel.name + ": normal operation has " +
            std::to_string(series.size()) + " stretches of " +
            std::to_string(models.decision.detection_samples) +
            " residuals (detection_samples), limits need at least " +
            std::to_string(kMinValues));
      }
      const double floor = 1e-6 + std::sqrt(Variance(joined));
      return std::max(floor, FitTail(series, share, separation).level) + slow;
    };
    channel.upper_threshold = level(1.0);
    channel.lower_threshold = -level(-1.0);
    for (const int length : windows[c]) {
      auto limits = FitWindowLimits(
          residuals[c], commands.empty() ? ResidualSeries() : commands[c],
          length, share, ReadsCommand(models, c), block);
      if (limits) {
        const double least = IsInput(channel.output)
                                 ? kMinMeanOfInput * std::sqrt(Variance(joined))
                                 : 0.0;
        limits->upper_mean = std::max(limits->upper_mean + slow, least);
        limits->lower_mean = std::min(limits->lower_mean - slow, -least);
        channel.windows.push_back(*limits);
      }
    }
  }
  models.threshold_hours = static_cast<double>(Joined(residuals[0]).size()) *
                           models.sample_period_s / 3600.0;
  models.false_alarms_per_hour = rate_per_hour;
}

void BalanceThresholds(const std::vector<ResidualSeries>& residuals,
                       ModelSet& models) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const double minutes = static_cast<double>(Joined(residuals[c]).size()) *
                           models.sample_period_s / 60.0;
    if (minutes < kLeastMinutes ||
        IsFreeRunning(models.observers.front().channels[c].model)) {
      ChannelSpec& channel = models.channels[c];
      channel.upper_threshold =
          std::max(channel.upper_threshold, -channel.lower_threshold);
      channel.lower_threshold = -channel.upper_threshold;
    }
  }
}

}  // namespace fdi::trainer
