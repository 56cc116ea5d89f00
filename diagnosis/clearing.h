#pragma once

#include <array>
#include <span>
#include <vector>

#include "diagnosis/model_set.h"

namespace fdi {

/// Decides when a valve with an open episode is normal again: over the last
/// t_c samples no residual beyond its threshold, d_0 ≥ T in at least the
/// isolation fraction of them, and the mean residual within 0.3 thresholds,
/// so that a fault that hovers below the threshold does not clear.
class ClearingWindow {
 public:
  explicit ClearingWindow(const ModelSet& models);

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

  const ModelSet* models_;
  int quiet_{0};  // samples since the last abnormal one
  int filled_{0};
  std::size_t next_{0};
  int normal_count_{0};
  std::vector<Entry> ring_;
  std::array<double, kMaxChannels> sums_{};
};

}  // namespace fdi
