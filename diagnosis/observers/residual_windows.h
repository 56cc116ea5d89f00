#pragma once

#include <span>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/snapshot.h"

namespace fdi {

/// Mean and energy of residuals over windows with exponential memory. For the
/// n-th value the gain is g = max(1/n, 1/N), so that a window grows until it
/// reaches its length N,
///
///     v ← (1 − g) (v + g (r − m)²),   m ← m + g (r − m);
///
/// the energy is ½ log v. Small and slow faults show here long before single
/// residuals exceed a threshold.
class ResidualWindow {
 public:
  explicit ResidualWindow(int length) : length_(length) {}

  void Restart() { *this = ResidualWindow(length_); }
  void Push(double residual);

  bool full() const { return count_ >= length_; }
  double mean() const { return mean_; }
  double variance() const { return variance_; }
  double log_rms() const;

  void Save(SnapshotWriter& writer) const;
  /// @returns false if the snapshot has no window of this length.
  bool Restore(SnapshotReader& reader);

 private:
  int length_;
  int count_{0};
  double mean_{0.0};
  double variance_{0.0};
};

/// The limit on the energy of a window, given the activity of `command`, the
/// window of CV over the same samples; see WindowLimits. The activity is capped
/// at four times that of training.
double UpperLogRms(const WindowLimits& limits, const ResidualWindow& command);

/// True if the limits apply to a window: it is full, and its mean of CV is in
/// the range that they were fitted to. Without CV they always apply.
bool Applies(const WindowLimits& limits, const ResidualWindow& window,
             const ResidualWindow& command);

/// True if limits that apply are exceeded.
bool IsBeyond(const WindowLimits& limits, const ResidualWindow& window,
              const ResidualWindow& command);

/// The windows of all channels of a model set, each with the window of CV over
/// the same samples.
class ResidualWindows {
 public:
  explicit ResidualWindows(const ModelSet& models);

  void Restart();

  /// @param residuals of the normal observer by channel; NaN abstains.
  /// @param cv NaN without the signal: limits are not raised.
  void Push(std::span<const double> residuals, double cv);

  void Save(SnapshotWriter& writer) const;
  bool Restore(SnapshotReader& reader);

  const ResidualWindow& window(std::size_t channel, std::size_t index) const {
    return windows_[channel][index].residual;
  }
  const ResidualWindow& command(std::size_t channel, std::size_t index) const {
    return windows_[channel][index].command;
  }

 private:
  struct Pair {
    ResidualWindow residual;
    ResidualWindow command;
  };
  std::vector<std::vector<Pair>> windows_;  // per channel
};

}  // namespace fdi
