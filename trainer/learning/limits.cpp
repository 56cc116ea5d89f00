#include "trainer/learning/limits.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/observer_bank.h"
#include "diagnosis/observers/residual_windows.h"
#include "trainer/calibration.h"
#include "trainer/rule_text.h"

namespace fdi::trainer {
namespace {

constexpr double kCommandsCovered = 0.8;
constexpr double kSeenMean = 1.5;     // times what was seen; as in calibration
constexpr double kSeenLogRms = 0.25;  // more than what was seen; likewise

// Calls visit(channel, window or null, kind, limit) for every limit, in the
// order of LimitsOf(). That on a deviation is a logarithm.
template <typename Models, typename Visitor>
void VisitLimits(Models& models, Visitor visit) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    auto& channel = models.channels[c];
    // A null pointer to a window that is const if the models are.
    decltype(&channel.windows[0]) none = nullptr;
    visit(c, none, LimitKind::kLower, channel.lower_threshold);
    visit(c, none, LimitKind::kUpper, channel.upper_threshold);
    for (auto& window : channel.windows) {
      visit(c, &window, LimitKind::kLowerMean, window.lower_mean);
      visit(c, &window, LimitKind::kUpperMean, window.upper_mean);
      visit(c, &window, LimitKind::kDeviation, window.upper_log_rms);
    }
  }
}

// Counts how much of each limit residuals use up, sample by sample.
class LimitUse {
 public:
  explicit LimitUse(const ModelSet& models)
      : models_(&models), windows_(models) {
    for (const Limit& limit : LimitsOf(models)) {
      kinds_.push_back(limit.kind);
    }
    shares_.resize(kinds_.size());
    sustained_.resize(kinds_.size(),
                      Sustained(models.decision.detection_samples));
  }

  void Restart() {
    windows_.Restart();
    for (Sustained& sustained : sustained_) {
      sustained.Restart();
    }
  }

  // @param residuals by channel; NaN abstains, and leaves its shares as they
  //   were.
  // @return the shares for n_d samples, parallel to LimitsOf().
  const std::vector<double>& Push(std::span<const double> residuals,
                                  double command) {
    windows_.Push(residuals, command);
    std::size_t i = 0;
    VisitLimits(*models_, [&](std::size_t c, const WindowLimits* window,
                              LimitKind, double) {
      if (!std::isnan(residuals[c])) {
        shares_[i] = sustained_[i].Push(ShareOf(c, window, i, residuals[c]));
      }
      ++i;
    });
    return shares_;
  }

 private:
  double ShareOf(std::size_t c, const WindowLimits* limits, std::size_t i,
                 double residual) const;

  const ModelSet* models_;
  ResidualWindows windows_;
  std::vector<LimitKind> kinds_;
  std::vector<double> shares_;
  std::vector<Sustained> sustained_;
};

double LimitUse::ShareOf(std::size_t c, const WindowLimits* limits,
                         std::size_t i, double residual) const {
  const ChannelSpec& channel = models_->channels[c];
  // A lower limit is negative, so that a share is positive on its side of zero
  // and exceeds 1 beyond it, as for an upper one.
  if (limits == nullptr) {
    return residual / (kinds_[i] == LimitKind::kLower
                           ? channel.lower_threshold
                           : channel.upper_threshold);
  }
  const auto w = static_cast<std::size_t>(limits - channel.windows.data());
  const ResidualWindow& window = windows_.window(c, w);
  const ResidualWindow& command = windows_.command(c, w);
  if (!Applies(*limits, window, command)) {
    return 0.0;
  }
  switch (kinds_[i]) {
    case LimitKind::kLowerMean:
      return window.mean() / limits->lower_mean;
    case LimitKind::kUpperMean:
      return window.mean() / limits->upper_mean;
    default:
      // The limit depends on the motion of CV (docs/method.md), so the
      // share is that of the limit at this motion.
      return std::exp(window.log_rms() - UpperLogRms(*limits, command));
  }
}

std::vector<ResidualSeries> SeriesOf(const HealthyResiduals& data,
                                     std::size_t channels, bool commands) {
  std::vector<ResidualSeries> all(channels);
  for (std::size_t c = 0; c < channels; ++c) {
    for (const ResidualStretch& stretch : data.stretches) {
      std::vector<double>& series = all[c].emplace_back();
      for (std::size_t k = 0; k < stretch.stamps_ns.size(); ++k) {
        const double residual = stretch.residuals[c][k];
        if (!std::isnan(residual)) {
          series.push_back(commands ? stretch.commands[k] : residual);
        }
      }
    }
  }
  return all;
}

WindowLimits* WindowOf(ChannelSpec& channel, int length) {
  const auto found =
      std::ranges::find(channel.windows, length, &WindowLimits::length);
  return found == channel.windows.end() ? nullptr : &*found;
}

// The limits of the parent cover the dead bands (CoverDeadBands()), which no
// residual shows.
void KeepWide(const ModelSet& parent, ModelSet& fitted) {
  for (std::size_t c = 0; c < parent.channels.size(); ++c) {
    const ChannelSpec& before = parent.channels[c];
    ChannelSpec& now = fitted.channels[c];
    now.lower_threshold = std::min(now.lower_threshold, before.lower_threshold);
    now.upper_threshold = std::max(now.upper_threshold, before.upper_threshold);
    for (std::size_t w = 0; w < before.windows.size(); ++w) {
      const WindowLimits& then = before.windows[w];
      WindowLimits& limits = now.windows[w];
      limits.lower_mean = std::min(limits.lower_mean, then.lower_mean);
      limits.upper_mean = std::max(limits.upper_mean, then.upper_mean);
      limits.upper_log_rms = std::max(limits.upper_log_rms, then.upper_log_rms);
    }
  }
}

// The parent with the limits that FitThresholds() gives for the data; a window
// that they are too short for keeps those that it has.
ModelSet FitToData(const ModelSet& parent, const HealthyResiduals& data) {
  const std::size_t channels = parent.channels.size();
  const std::vector<ResidualSeries> residuals = SeriesOf(data, channels, false);
  ModelSet fitted = parent;
  std::vector<std::vector<int>> lengths(channels);
  for (std::size_t c = 0; c < channels; ++c) {
    const std::size_t count = Joined(residuals[c]).size();
    if (count < kMinResiduals) {
      throw DataError("channel " + parent.channels[c].name + " has " +
                      std::to_string(count) +
                      " residuals in the healthy data, needed are " +
                      std::to_string(kMinResiduals));
    }
    for (const WindowLimits& window : parent.channels[c].windows) {
      lengths[c].push_back(window.length);
    }
    fitted.channels[c].windows.clear();
  }
  FitThresholds(residuals, lengths, parent.false_alarms_per_hour, fitted,
                SeriesOf(data, channels, true));
  for (std::size_t c = 0; c < channels; ++c) {
    std::vector<WindowLimits> windows = parent.channels[c].windows;
    for (WindowLimits& window : windows) {
      const WindowLimits* now = WindowOf(fitted.channels[c], window.length);
      window = now != nullptr ? *now : window;
    }
    fitted.channels[c].windows = std::move(windows);
  }
  BalanceThresholds(residuals, fitted);
  if (parent.every.x == ReadEvery::kOnChange ||
      parent.every.f == ReadEvery::kOnChange) {
    KeepWide(parent, fitted);
  }
  return fitted;
}

// True if the data went over as many commands as limits hold for: those of a
// valve that stood still say nothing about one that moves.
bool CoversCommands(const ModelSet& parent, const ModelSet& fitted) {
  for (std::size_t c = 0; c < parent.channels.size(); ++c) {
    for (std::size_t w = 0; w < parent.channels[c].windows.size(); ++w) {
      const SignalRange& before = parent.channels[c].windows[w].command;
      const SignalRange& now = fitted.channels[c].windows[w].command;
      const double both = std::min(before.maximum, now.maximum) -
                          std::max(before.minimum, now.minimum);
      // Without CV the range of a window is unbounded and asks for nothing.
      if (std::isfinite(before.maximum - before.minimum) &&
          both < kCommandsCovered * (before.maximum - before.minimum)) {
        return false;
      }
    }
  }
  return true;
}

void WidenCommands(const ModelSet& fitted, ModelSet& models) {
  for (std::size_t c = 0; c < fitted.channels.size(); ++c) {
    for (std::size_t w = 0; w < fitted.channels[c].windows.size(); ++w) {
      const SignalRange& more = fitted.channels[c].windows[w].command;
      SignalRange& now = models.channels[c].windows[w].command;
      now = {std::min(more.minimum, now.minimum),
             std::max(more.maximum, now.maximum)};
    }
  }
}

// The wider limit that replaces one exceeded by the factor `share`.
double Loosened(LimitKind kind, double before, double fitted, double share) {
  // share = e^(log rms − limit) at the peak, so limit + ln share is the log rms
  // seen there, less what the motion of CV explains.
  if (kind == LimitKind::kDeviation) {
    return before + std::log(share) + kSeenLogRms;
  }
  // share = seen/limit. The fitted limit holds only if it lies beyond what was
  // seen.
  const double seen = std::abs(share * before);
  const double most = kSeenMean * seen;
  return std::copysign(
      std::abs(fitted) > seen ? std::min(std::abs(fitted), most) : most,
      before);
}

// Takes the closer one of two limits that hold for the data.
void Tighten(LimitKind kind, const WindowLimits* fitted_window, double fitted,
             WindowLimits* window, double& limit) {
  // The slope and the usual motion of CV belong to the limit on a deviation:
  // the tail was fitted to the excess above their line.
  if (kind == LimitKind::kDeviation && fitted < limit) {
    window->activity_slope = fitted_window->activity_slope;
    window->log_activity = fitted_window->log_activity;
    limit = fitted;
  } else if (kind != LimitKind::kDeviation &&
             std::abs(fitted) < std::abs(limit)) {
    limit = fitted;
  }
}

// The parent with limits that the data passed made wider, and the others made
// as close as the fitted ones if `tighten`.
ModelSet Combine(const ModelSet& parent, const ModelSet& fitted,
                 const std::vector<Peak>& peaks, bool tighten) {
  std::vector<std::pair<const WindowLimits*, double>> asked;
  VisitLimits(fitted, [&](std::size_t, const WindowLimits* window, LimitKind,
                          double limit) { asked.emplace_back(window, limit); });
  ModelSet models = parent;
  std::size_t i = 0;
  VisitLimits(models, [&](std::size_t, WindowLimits* window, LimitKind kind,
                          double& limit) {
    // A limit that was passed becomes wider whatever the amount of data,
    // because one alarm of a healthy valve proves it too close. Closer limits
    // take as much evidence as the old ones rest on.
    if (peaks[i].share > 1.0) {
      limit = Loosened(kind, limit, asked[i].second, peaks[i].share);
    } else if (tighten) {
      Tighten(kind, asked[i].first, asked[i].second, window, limit);
    }
    ++i;
  });
  return models;
}

}  // namespace

std::string_view LimitKindName(LimitKind kind) {
  constexpr std::array<std::string_view, 5> kNames{
      "lower", "upper", "lower_mean", "upper_mean", "deviation"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string LimitText(const Limit& limit) {
  const std::string over =
      limit.window > 0 ? " over " + std::to_string(limit.window) + " samples"
                       : "";
  switch (limit.kind) {
    case LimitKind::kLower:
      return "lower threshold";
    case LimitKind::kUpper:
      return "upper threshold";
    case LimitKind::kLowerMean:
      return "lower mean" + over;
    case LimitKind::kUpperMean:
      return "upper mean" + over;
    case LimitKind::kDeviation:
      return "deviation" + over;
  }
  return "";
}

std::vector<Limit> LimitsOf(const ModelSet& models) {
  std::vector<Limit> limits;
  VisitLimits(models, [&](std::size_t c, const WindowLimits* window,
                          LimitKind kind, double value) {
    limits.push_back({c, window != nullptr ? window->length : 0, kind,
                      kind == LimitKind::kDeviation ? std::exp(value) : value});
  });
  return limits;
}

std::vector<Peak> PeaksOf(const ModelSet& models,
                          const HealthyResiduals& data) {
  LimitUse use(models);
  std::vector<Peak> peaks(LimitsOf(models).size());
  std::vector<double> residuals(models.channels.size());
  for (const ResidualStretch& stretch : data.stretches) {
    use.Restart();
    for (std::size_t k = 0; k < stretch.stamps_ns.size(); ++k) {
      for (std::size_t c = 0; c < residuals.size(); ++c) {
        residuals[c] = stretch.residuals[c][k];
      }
      const std::vector<double>& shares =
          use.Push(residuals, stretch.commands[k]);
      for (std::size_t i = 0; i < peaks.size(); ++i) {
        if (shares[i] > peaks[i].share) {
          peaks[i] = {shares[i], stretch.run, stretch.stamps_ns[k]};
        }
      }
    }
  }
  return peaks;
}

NewLimits SetLimits(const ModelSet& parent, const HealthyResiduals& data) {
  const ModelSet fitted = FitToData(parent, data);
  NewLimits result;
  result.hours =
      static_cast<double>(data.samples) * parent.sample_period_s / 3600.0;
  result.fitted =
      result.hours >= parent.threshold_hours && CoversCommands(parent, fitted);
  result.models = Combine(parent, fitted, PeaksOf(parent, data), result.fitted);
  // All limits were now judged by these data, too, and apply at their commands
  // as well.
  if (result.fitted) {
    WidenCommands(fitted, result.models);
    result.models.threshold_hours = fitted.threshold_hours;
  }
  result.models.floor = data.floor ? data.floor : parent.floor;
  Validate(result.models);
  return result;
}

void RequireHealthy(const ModelSet& first, const ModelSet& parent,
                    const std::vector<Peak>& peaks) {
  const std::vector<Limit> limits = LimitsOf(first);
  const std::vector<Limit> now = LimitsOf(parent);
  std::size_t worst = 0;
  double most = 0.0;
  // share · now is what was seen; it is measured by the limits of onboarding.
  // By those of the parent, limits could be widened again and again, each time
  // by a little.
  for (std::size_t i = 0; i < limits.size(); ++i) {
    const double times = peaks[i].share * now[i].value / limits[i].value;
    if (peaks[i].share > 1.0 && times > most) {
      worst = i;
      most = times;
    }
  }
  if (most <= kMaxReachRatio) {
    return;
  }
  throw DataError(
      "run " + peaks[worst].run + " at " +
      FormatTime(peaks[worst].stamp_ns, true) + ", channel " +
      first.channels[limits[worst].channel].name + ": the residual is at " +
      Digits(most, 3) + " times the limit of onboarding (" +
      LimitText(limits[worst]) + "), accepted is up to " +
      Digits(kMaxReachRatio, 2) +
      " times. That is hardly a healthy valve: leave this time out (--runs "
      "ID@from:to). If the valve was healthy, label its episode false, or make "
      "its models anew with these hours (--models)");
}

// On a valve that follows its normal model exactly, only fault i makes the
// residual
//
//     r = y − ŷ_0 = ŷ_i − ŷ_0.
//
// Both sets are asked whether it passes a limit in one run of the bank,
// because they have the same observers.
std::vector<CoverageChange> CompareVisibility(
    const ModelSet& before, const ModelSet& after,
    const std::vector<Sample>& samples) {
  const std::size_t observers = before.observers.size();
  std::array<std::vector<LimitUse>, 2> uses{
      std::vector<LimitUse>(observers, LimitUse(before)),
      std::vector<LimitUse>(observers, LimitUse(after))};
  std::array<std::vector<bool>, 2> seen{std::vector<bool>(observers),
                                        std::vector<bool>(observers)};
  ObserverBank bank(before);
  std::vector<double> effect(before.channels.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (k == 0) {
      bank.Initialise(samples[k]);
    }
    bank.Step(samples[k]);
    for (std::size_t i = 1; i < observers; ++i) {
      const int observer = static_cast<int>(i);
      for (std::size_t c = 0; c < effect.size(); ++c) {
        const int channel = static_cast<int>(c);
        effect[c] = bank.active(channel) ? bank.prediction(observer, channel) -
                                               bank.prediction(0, channel)
                                         : std::nan("");
      }
      for (std::size_t set = 0; set < uses.size(); ++set) {
        const std::vector<double>& shares =
            uses[set][i].Push(effect, samples[k][Signal::kCv]);
        seen[set][i] = seen[set][i] || std::ranges::max(shares) > 1.0;
      }
    }
  }
  // From the largest strength down, as long as the fault is seen. A smaller
  // strength that is seen by chance below one that is not does not count.
  std::map<std::pair<int, bool>, std::vector<std::size_t>> directions;
  for (std::size_t i = 1; i < observers; ++i) {
    const Observer& observer = before.observers[i];
    directions[{observer.fault, observer.strength < 0.0}].push_back(i);
  }
  std::vector<CoverageChange> faults;
  for (auto& [key, chain] : directions) {
    const auto strength = [&](std::size_t i) {
      return std::abs(before.observers[i].strength);
    };
    std::ranges::sort(chain, std::greater<>(), strength);
    CoverageChange& fault =
        faults.emplace_back(CoverageChange{key.first, key.second, {}, {}});
    for (std::size_t set = 0; set < seen.size(); ++set) {
      std::optional<double>& smallest = set == 0 ? fault.before : fault.after;
      for (const std::size_t i : chain) {
        if (!seen[set][i]) {
          break;
        }
        smallest = strength(i);
      }
    }
  }
  return faults;
}

}  // namespace fdi::trainer
