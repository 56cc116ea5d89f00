#pragma once

#include <algorithm>
#include <cstddef>

#include "base/correlation.h"

namespace fdi {

/// Tells if one signal rises or falls with another: the sign that most
/// stretches of 60 pairs have. A fault that lasts, such as a shut line, says
/// nothing about it, and would decide a correlation of the whole record.
class LocalSense {
 public:
  void Add(double u, double v) {
    all_.Add(u, v);
    part_.Add(u, v);
    if (part_.n >= kStretch) {
      rising_ += part_.Correlation() > kClear ? 1U : 0U;
      falling_ += part_.Correlation() < -kClear ? 1U : 0U;
      part_ = {};
    }
  }

  /// 1 or -1; where few stretches tell, the correlation of all pairs.
  double Value() const {
    const std::size_t votes = rising_ + falling_;
    if (votes >= kMinVotes && 4 * std::max(rising_, falling_) >= 3 * votes) {
      return rising_ > falling_ ? 1.0 : -1.0;
    }
    return all_.Correlation();
  }

 private:
  static constexpr double kStretch = 60.0;
  static constexpr double kClear = 0.6;
  static constexpr std::size_t kMinVotes = 5;

  CorrelationSums all_;
  CorrelationSums part_;
  std::size_t rising_{0};
  std::size_t falling_{0};
};

}  // namespace fdi
