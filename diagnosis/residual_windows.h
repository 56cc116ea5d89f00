#pragma once

#include <span>
#include <vector>

#include "diagnosis/model_set.h"
#include "diagnosis/snapshot.h"

namespace fdi {

/// Mean and energy of residuals over windows of exponential memory. With the
/// n-th value, gain g = max(1/n, 1/N), so that a window grows until its length
/// N is reached,
///
///     v ← (1 − g) (v + g (r − m)²),   m ← m + g (r − m);
///
/// the energy is ½ log v. Small and slow faults show there long before single
/// residuals pass a threshold.
class ResidualWindow {
 public:
  explicit ResidualWindow(int length) : length_(length) {}

  void Restart() { *this = ResidualWindow(length_); }
  void Push(double residual);

  bool full() const { return count_ >= length_; }
  double mean() const { return mean_; }
  double log_rms() const;

  void Save(SnapshotWriter& writer) const;
  /// @returns false if there is no window of this length to be read.
  bool Restore(SnapshotReader& reader);

 private:
  int length_;
  int count_{0};
  double mean_{0.0};
  double variance_{0.0};
};

/// The limit on the energy of a window while `command`, the window of CV over
/// the same samples, is as active as it is; see WindowLimits. The activity
/// counts up to four times that of the training.
double UpperLogRms(const WindowLimits& limits, const ResidualWindow& command);

/// True if the limits hold for a window: it is full, and the mean of CV over it
/// is one that they were fitted to. Without CV they always hold.
bool Applies(const WindowLimits& limits, const ResidualWindow& window,
             const ResidualWindow& command);

/// True if limits that apply are passed.
bool IsBeyond(const WindowLimits& limits, const ResidualWindow& window,
              const ResidualWindow& command);

/// The windows of all channels of a model set, each with that of CV over the
/// same samples.
class ResidualWindows {
 public:
  explicit ResidualWindows(const ModelSet& models);

  void Restart();

  /// @param residuals of the normal observer, one per channel; NaN abstains.
  /// @param cv NaN without the signal: no limit is raised.
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
