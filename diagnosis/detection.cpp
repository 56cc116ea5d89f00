#include "diagnosis/detection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

namespace fdi {
namespace {

// What is left of a residual when the extrapolation in it is taken away.
double SoftThreshold(double residual, double uncertain) {
  return std::copysign(std::max(std::abs(residual) - uncertain, 0.0), residual);
}

constexpr double kFollowingS = 8.0 * 3600.0;
constexpr double kFirstS = 3600.0;
constexpr double kMargin = 1.4;  // of the limit on the energy, in training

// One step of `value` towards `target`.
double Towards(double target, double value, double step) {
  return value + std::clamp(target - value, -step, step);
}

// Of a drift that uses so much of its bound; a window that wavers there, by
// which it falls back a little, begins nothing anew.
std::int64_t FullSince(std::int64_t since_ns, double used,
                       std::int64_t stamp_ns) {
  if (used < kNearBound) {
    return 0;
  }
  return since_ns == 0 && used >= 1.0 ? stamp_ns : since_ns;
}

}  // namespace

Detection::Detection(const ModelSet& models)
    : models_(&models), windows_(models) {}

void Detection::Restart() {
  windows_.Restart();
  runs_.fill({});
}

bool Detection::Push(const ObserverBank& bank, const Sample& sample) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::int64_t stamp_ns = sample.stamp_ns;
  const std::size_t channels = models_->channels.size();
  std::array<double, kMaxChannels> certain{};
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    certain[c] = bank.active(channel)
                     ? SoftThreshold(
                           bank.residual(0, channel),
                           kExtrapolationError * bank.extrapolation(0, channel))
                     : kNan;
  }
  windows_.Push({certain.data(), channels},
                sample.Has(Signal::kCv) ? sample[Signal::kCv] : kNan);
  bool abnormal = false;
  for (std::size_t c = 0; c < channels; ++c) {
    const int index = static_cast<int>(c);
    if (bank.active(index) && !bank.measured(index)) {
      continue;  // Neither goes on nor interrupts.
    }
    const ChannelSpec& channel = models_->channels[c];
    const Drift& drift = drifts_[c];
    const double scale = std::exp(drift.log_scale);
    std::size_t test = c * kTestsPerChannel;
    const double residual = (certain[c] - drift.mean) / scale;
    const bool below = residual < channel.lower_threshold;
    const bool above = residual > channel.upper_threshold;
    abnormal = abnormal || below || above;
    Count(test++, below, stamp_ns);
    Count(test++, above, stamp_ns);
    for (std::size_t w = 0; w < channel.windows.size(); ++w) {
      const WindowLimits& limits = channel.windows[w];
      const ResidualWindow& window = windows_.window(c, w);
      const ResidualWindow& command = windows_.command(c, w);
      const bool applies = Applies(limits, window, command);
      const double mean = window.mean() - drift.mean;
      const double log_rms = window.log_rms() - drift.log_scale;
      Count(test++, applies && mean < limits.lower_mean, stamp_ns);
      Count(test++, applies && mean > limits.upper_mean, stamp_ns);
      Count(test++, applies && log_rms > UpperLogRms(limits, command),
            stamp_ns);
    }
  }
  return abnormal;
}

void Detection::AdaptLimits(std::int64_t stamp_ns) {
  healthy_s_ += models_->sample_period_s;
  if (healthy_s_ <= kFirstS) {
    return;
  }
  const double share = models_->sample_period_s / kFollowingS;
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const std::vector<WindowLimits>& windows = models_->channels[c].windows;
    const DriftLimits& most = models_->channels[c].drift;
    if (windows.empty()) {
      continue;
    }
    const std::size_t longest = windows.size() - 1;
    const WindowLimits& limits = windows[longest];
    const ResidualWindow& window = windows_.window(c, longest);
    const ResidualWindow& command = windows_.command(c, longest);
    if (!Applies(limits, window, command)) {
      continue;
    }
    Drift& drift = drifts_[c];
    const double usual = UpperLogRms(limits, command) - std::log(kMargin);
    const double band = 0.5 * (limits.upper_mean - limits.lower_mean);
    drift.mean = std::clamp(Towards(window.mean(), drift.mean, share * band),
                            most.lower_mean, most.upper_mean);
    drift.log_scale =
        std::clamp(Towards(window.log_rms() - usual, drift.log_scale,
                           share * std::numbers::ln2),
                   0.0, most.log_scale);
    const FollowedDrift now = followed_drift(c);
    drift.mean_full_ns =
        FullSince(drift.mean_full_ns, now.mean_used(), stamp_ns);
    drift.scale_full_ns =
        FullSince(drift.scale_full_ns, now.scale_used(), stamp_ns);
  }
}

FollowedDrift Detection::followed_drift(std::size_t channel) const {
  const Drift& drift = drifts_.at(channel);
  const DriftLimits& most = models_->channels.at(channel).drift;
  return {
      drift.mean,         drift.mean < 0.0 ? most.lower_mean : most.upper_mean,
      drift.log_scale,    most.log_scale,
      drift.mean_full_ns, drift.scale_full_ns};
}

void Detection::Save(SnapshotWriter& writer) const {
  windows_.Save(writer);
  writer.Put(healthy_s_);
  for (const Drift& drift : drifts_) {
    writer.Put(drift.mean, drift.log_scale, drift.mean_full_ns,
               drift.scale_full_ns);
  }
}

bool Detection::Restore(SnapshotReader& reader) {
  return windows_.Restore(reader) && reader.Get(healthy_s_) &&
         std::isfinite(healthy_s_) &&
         std::ranges::all_of(drifts_, [&](Drift& drift) {
           return reader.Get(drift.mean, drift.log_scale, drift.mean_full_ns,
                             drift.scale_full_ns) &&
                  std::isfinite(drift.mean) && std::isfinite(drift.log_scale);
         });
}

void Detection::Count(std::size_t test, bool beyond, std::int64_t stamp_ns) {
  Run& run = runs_[test];
  run.since_ns = beyond && run.length == 0 ? stamp_ns : run.since_ns;
  run.length = beyond ? run.length + 1 : 0;
}

bool Detection::pending() const {
  return std::ranges::any_of(runs_,
                             [](const Run& run) { return run.length > 0; });
}

std::optional<std::int64_t> Detection::stamp_ns() const {
  std::optional<std::int64_t> stamp;
  const std::size_t tests = models_->channels.size() * kTestsPerChannel;
  for (const Run& run : std::span(runs_).first(tests)) {
    if (run.length >= models_->decision.detection_samples) {
      stamp = std::min(stamp.value_or(run.since_ns), run.since_ns);
    }
  }
  return stamp;
}

}  // namespace fdi
