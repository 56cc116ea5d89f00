#include "diagnosis/observers/detection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "diagnosis/model/exponential.h"

namespace fdi {
namespace {

// exp(t), by our own function on either side of zero.
double Growth(double t) {
  return t > 0.0 ? 1.0 / Exp(-t) : Exp(t);
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
      shares_(models.channels.size() * kTestsPerChannel,
              Sustained(models.decision.detection_samples)) {}

void Detection::Restart() {
  windows_.Restart();
  Interrupt();
}

void Detection::Interrupt() {
  runs_.fill({});
  for (Sustained& share : shares_) {
    share.Restart();
  }
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
  share_ = 0.0;
  for (std::size_t c = 0; c < channels; ++c) {
    const int index = static_cast<int>(c);
    const bool unread = bank.active(index) && !bank.measured(index);
    const bool held_out = unread && !held.empty() && !std::isnan(held[c]);
    if (unread && !held_out) {
      continue;  // Neither goes on nor interrupts.
    }
    const ChannelSpec& channel = models_->channels[c];
    std::size_t test = c * kTestsPerChannel;
    const double residual = held_out ? held[c] : certain[c];
    const bool below = residual < channel.lower_threshold;
    const bool above = residual > channel.upper_threshold;
    abnormal = abnormal || below || above;
    Count(test++, below, residual / channel.lower_threshold, stamp_ns);
    Count(test++, above, residual / channel.upper_threshold, stamp_ns);
    if (held_out) {
      continue;
    }
    for (std::size_t w = 0; w < channel.windows.size(); ++w) {
      const WindowLimits& limits = channel.windows[w];
      const ResidualWindow& window = windows_.window(c, w);
      const ResidualWindow& command = windows_.command(c, w);
      const bool applies = Applies(limits, window, command);
      const auto count = [&](bool beyond, double share) {
        Count(test++, applies && beyond, applies ? share : 0.0, stamp_ns);
      };
      const double energy = window.log_rms() - UpperLogRms(limits, command);
      count(window.mean() < limits.lower_mean,
            window.mean() / limits.lower_mean);
      count(window.mean() > limits.upper_mean,
            window.mean() / limits.upper_mean);
      count(energy > 0.0, Growth(energy));
    }
  }
  return abnormal;
}

void Detection::Save(SnapshotWriter& writer) const {
  windows_.Save(writer);
}

bool Detection::Restore(SnapshotReader& reader) {
  return windows_.Restore(reader);
}

void Detection::Count(std::size_t test, bool beyond, double share,
                      std::int64_t stamp_ns) {
  Run& run = runs_[test];
  // In this order a NaN counts as 0.
  share_ = std::max(share_, shares_[test].Push(std::max(0.0, share)));
  run.since_ns = beyond && run.length == 0 ? stamp_ns : run.since_ns;
  run.length = beyond ? run.length + 1 : 0;
}

bool Detection::pending() const {
  const std::size_t tests = models_->channels.size() * kTestsPerChannel;
  return std::ranges::any_of(std::span(runs_).first(tests),
                             [](const Run& run) { return run.length > 0; });
}

std::uint32_t Detection::beyond() const {
  std::uint32_t channels = 0;
  for (std::size_t t = 0; t < models_->channels.size() * kTestsPerChannel;
       ++t) {
    if (runs_[t].length >= models_->decision.detection_samples) {
      channels |= std::uint32_t{1} << (t / kTestsPerChannel);
    }
  }
  return channels;
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
