#pragma once

#include <array>
#include <span>
#include <vector>

#include "diagnosis/model_set.h"

namespace fdi {

/// The commands of the last samples.
class CommandHistory {
 public:
  explicit CommandHistory(int length)
      : ring_(static_cast<std::size_t>(length)) {}

  void Push(double cv);

  /// Standard deviation of CV, 0 without samples [%].
  double deviation() const;
  /// Largest less smallest CV [%].
  double range() const;

 private:
  std::vector<double> ring_;
  std::size_t filled_{0};
  std::size_t next_{0};
};

/// Decides when a valve with an open episode is normal again: over the last
/// t_c samples no residual beyond its threshold, d_0 ≥ T in at least the
/// isolation fraction of them, and the mean residual within 0.3 thresholds,
/// so that a fault that hovers below the threshold does not clear.
///
/// A valve that stands still is not healthy, it is silent: CV must vary at
/// least half as much as it did when the fault was detected, or have covered
/// as wide a range since the last residual beyond a threshold.
class ClearingWindow {
 public:
  explicit ClearingWindow(const ModelSet& models);

  /// Takes the command of every sample that is judged, episode or not.
  void Observe(double cv);

  /// A detection.
  void Restart();

  /// @param residuals of the normal observer, one per channel; NaN abstains.
  void Push(std::span<const double> residuals, double normal_factor,
            bool abnormal);

  bool Cleared() const;

 private:
  struct Entry {
    std::array<double, kMaxChannels> residuals{};
    bool normal{false};
  };

  bool Excited() const;

  const ModelSet* models_;
  CommandHistory commands_;
  double deviation_then_{0.0};  // of CV at the detection
  double range_then_{0.0};
  double lowest_{0.0};  // CV since the last abnormal sample
  double highest_{0.0};
  double cv_{0.0};
  int quiet_{0};  // samples since the last abnormal one
  int filled_{0};
  std::size_t next_{0};
  int normal_count_{0};
  std::vector<Entry> ring_;
  std::array<double, kMaxChannels> sums_{};
};

}  // namespace fdi
