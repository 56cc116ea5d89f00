#include "diagnosis/observers/residual_windows.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

constexpr double kMinVariance = 1e-24;
constexpr double kMaxActivity = 4.0;  // as a multiple of that in training

}  // namespace

void ResidualWindow::Push(double residual) {
  count_ = std::min(count_ + 1, length_);
  const double gain = 1.0 / count_;
  const double deviation = residual - mean_;
  variance_ = (1.0 - gain) * (variance_ + gain * deviation * deviation);
  mean_ += gain * deviation;
}

double ResidualWindow::log_rms() const {
  return 0.5 * std::log(std::max(variance_, kMinVariance));
}

void ResidualWindow::Save(SnapshotWriter& writer) const {
  writer.Put(length_, count_, mean_, variance_);
}

bool ResidualWindow::Restore(SnapshotReader& reader) {
  int length = 0;
  return reader.Get(length, count_, mean_, variance_) && length == length_ &&
         count_ >= 0 && count_ <= length_ && std::isfinite(mean_) &&
         std::isfinite(variance_) && variance_ >= 0.0;
}

double UpperLogRms(const WindowLimits& limits, const ResidualWindow& command) {
  if (!command.full()) {
    return limits.upper_log_rms;
  }
  const double more = std::clamp(command.log_rms() - limits.log_activity, 0.0,
                                 std::log(kMaxActivity));
  return limits.upper_log_rms + limits.activity_slope * more;
}

bool Applies(const WindowLimits& limits, const ResidualWindow& window,
             const ResidualWindow& command) {
  return window.full() &&
         (!command.full() || limits.command.Contains(command.mean()));
}

bool IsBeyond(const WindowLimits& limits, const ResidualWindow& window,
              const ResidualWindow& command) {
  return Applies(limits, window, command) &&
         (window.mean() < limits.lower_mean ||
          window.mean() > limits.upper_mean ||
          window.log_rms() > UpperLogRms(limits, command));
}

ResidualWindows::ResidualWindows(const ModelSet& models) {
  for (const ChannelSpec& channel : models.channels) {
    std::vector<Pair>& windows = windows_.emplace_back();
    for (const WindowLimits& limits : channel.windows) {
      windows.push_back(
          {ResidualWindow(limits.length), ResidualWindow(limits.length)});
    }
  }
}

void ResidualWindows::Restart() {
  for (auto& channel : windows_) {
    for (Pair& window : channel) {
      window.residual.Restart();
      window.command.Restart();
    }
  }
}

void ResidualWindows::Push(std::span<const double> residuals, double cv) {
  for (std::size_t c = 0; c < windows_.size(); ++c) {
    if (!std::isfinite(residuals[c])) {
      continue;
    }
    for (Pair& window : windows_[c]) {
      window.residual.Push(residuals[c]);
      if (std::isfinite(cv)) {
        window.command.Push(cv);
      }
    }
  }
}

void ResidualWindows::Save(SnapshotWriter& writer) const {
  for (const auto& channel : windows_) {
    for (const Pair& window : channel) {
      window.residual.Save(writer);
      window.command.Save(writer);
    }
  }
}

bool ResidualWindows::Restore(SnapshotReader& reader) {
  for (auto& channel : windows_) {
    for (Pair& window : channel) {
      if (!window.residual.Restore(reader) || !window.command.Restore(reader)) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace fdi
