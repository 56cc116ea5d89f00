#include "diagnosis/observers/detection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace fdi {
namespace {

std::size_t WindowsOf(const ModelSet& models) {
  std::size_t windows = 0;
  for (const ChannelSpec& channel : models.channels) {
    windows += channel.windows.size();
  }
  return windows;
}

}  // namespace

double CertainResidual(const ObserverBank& bank, int channel, double margin) {
  const double residual = bank.residual(0, channel);
  const double uncertain =
      kExtrapolationError * bank.extrapolation(0, channel) + margin;
  return std::copysign(std::max(std::abs(residual) - uncertain, 0.0), residual);
}

Detection::Detection(const ModelSet& models)
    : models_(&models),
      windows_(models),
      values_(models.decision.detection_samples,
              models.channels.size() + WindowsOf(models)),
      energies_(models.decision.detection_samples, WindowsOf(models)) {
  for (const ChannelSpec& channel : models.channels) {
    for (const WindowLimits& limits : channel.windows) {
      usual_.push_back({std::exp(-2.0 * limits.upper_log_rms),
                        limits.activity_slope == 0.0
                            ? std::numeric_limits<double>::infinity()
                            : std::exp(2.0 * limits.log_activity)});
    }
  }
}

void Detection::Restart() {
  windows_.Restart();
  Interrupt();
}

void Detection::Interrupt() {
  runs_.fill({});
  pending_ = 0;
  values_.Restart();
  energies_.Restart();
  share_ = 0.0;
}

bool Detection::Push(const ObserverBank& bank, const Sample& sample,
                     std::span<const double> margins,
                     std::span<const double> held) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::int64_t stamp_ns = sample.stamp_ns;
  const std::size_t channels = models_->channels.size();
  std::array<double, kMaxChannels> certain{};
  for (std::size_t c = 0; c < channels; ++c) {
    const int channel = static_cast<int>(c);
    certain[c] =
        bank.active(channel)
            ? CertainResidual(bank, channel, margins.empty() ? 0.0 : margins[c])
            : kNan;
  }
  windows_.Push({certain.data(), channels},
                sample.Has(Signal::kCv) ? sample[Signal::kCv] : kNan);
  bool abnormal = false;
  double energy_share = 0.0;
  std::size_t first_window = 0;
  share_ = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    const ChannelSpec& channel = models_->channels[c];
    const std::size_t first = first_window;
    first_window += channel.windows.size();
    const int index = static_cast<int>(c);
    const bool unread = bank.active(index) && !bank.measured(index);
    const bool held_out = unread && !held.empty() && !std::isnan(held[c]);
    if (unread && !held_out) {
      continue;  // Neither goes on nor interrupts.
    }
    std::size_t test = c * kTestsPerChannel;
    const double residual = held_out ? held[c] : certain[c];
    const bool below = residual < channel.lower_threshold;
    const bool above = residual > channel.upper_threshold;
    abnormal = abnormal || below || above;
    Count(test++, below, stamp_ns);
    Count(test++, above, stamp_ns);
    PushValue(residual, channel.lower_threshold, channel.upper_threshold, c);
    if (held_out) {
      continue;
    }
    for (std::size_t w = 0; w < channel.windows.size(); ++w) {
      const WindowLimits& limits = channel.windows[w];
      const ResidualWindow& window = windows_.window(c, w);
      const ResidualWindow& command = windows_.command(c, w);
      const bool applies = Applies(limits, window, command);
      const double mean = applies ? window.mean() : 0.0;
      // In this order of max() a NaN counts as none.
      const double energy =
          applies ? std::max(0.0, Energy(limits, window, command, first + w))
                  : 0.0;
      Count(test++, mean < limits.lower_mean, stamp_ns);
      Count(test++, mean > limits.upper_mean, stamp_ns);
      Count(test++, energy > 1.0, stamp_ns);
      PushValue(mean, limits.lower_mean, limits.upper_mean,
                channels + first + w);
      energy_share = energies_.Push(energy, first + w, energy_share);
    }
  }
  share_ = std::max(share_, std::sqrt(energy_share));
  return abnormal;
}

void Detection::Save(SnapshotWriter& writer) const {
  windows_.Save(writer);
}

bool Detection::Restore(SnapshotReader& reader) {
  return windows_.Restore(reader);
}

// Logarithms of all windows took a twentieth of an engine's time, and CV is
// seldom more active than in training.
double Detection::Energy(const WindowLimits& limits,
                         const ResidualWindow& window,
                         const ResidualWindow& command,
                         std::size_t series) const {
  const Usual& usual = usual_[series];
  if (!command.full() || command.variance() <= usual.activity) {
    return window.variance() * usual.per_variance;
  }
  return std::exp(2.0 * (window.log_rms() - UpperLogRms(limits, command)));
}

// The share of most values is below that of another test, which a product tells
// without a division. NaN counts as 0.
void Detection::PushValue(double value, double lower, double upper,
                          std::size_t series) {
  const double limit = value < 0.0 ? -lower : upper;
  const double most = share_ * limit;
  const double least =
      values_.PushSigned(std::isnan(value) ? 0.0 : value, series, most);
  share_ = least > most ? least / limit : share_;
}

// Almost always all runs are empty, and to read them all takes long.
void Detection::Count(std::size_t test, bool beyond, std::int64_t stamp_ns) {
  if (!beyond && pending_ == 0) {
    return;
  }
  Run& run = runs_[test];
  pending_ += (beyond ? 1 : 0) - (run.length > 0 ? 1 : 0);
  run.since_ns = beyond && run.length == 0 ? stamp_ns : run.since_ns;
  run.length = beyond ? run.length + 1 : 0;
}

std::uint32_t Detection::beyond() const {
  std::uint32_t channels = 0;
  const std::size_t tests = models_->channels.size() * kTestsPerChannel;
  for (std::size_t t = 0; pending() && t < tests; ++t) {
    if (runs_[t].length >= models_->decision.detection_samples) {
      channels |= std::uint32_t{1} << (t / kTestsPerChannel);
    }
  }
  return channels;
}

std::optional<std::int64_t> Detection::stamp_ns() const {
  std::optional<std::int64_t> stamp;
  const std::size_t tests = models_->channels.size() * kTestsPerChannel;
  for (const Run& run : std::span(runs_).first(pending() ? tests : 0)) {
    if (run.length >= models_->decision.detection_samples) {
      stamp = std::min(stamp.value_or(run.since_ns), run.since_ns);
    }
  }
  return stamp;
}

}  // namespace fdi
