#include "diagnosis/clearing.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

constexpr double kMeanShare = 0.3;  // of the threshold

}  // namespace

ClearingWindow::ClearingWindow(const ModelSet& models)
    : models_(&models),
      ring_(static_cast<std::size_t>(models.decision.clearing_samples)) {}

void ClearingWindow::Restart() {
  quiet_ = 0;
  filled_ = 0;
  next_ = 0;
  normal_count_ = 0;
  sums_.fill(0.0);
}

void ClearingWindow::Push(std::span<const double> residuals,
                          double normal_factor, bool abnormal) {
  quiet_ = abnormal ? 0 : quiet_ + 1;
  Entry& entry = ring_[next_];
  const bool full = filled_ == static_cast<int>(ring_.size());
  if (full) {
    normal_count_ -= entry.normal ? 1 : 0;
  }
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    const double value = std::isfinite(residuals[c]) ? residuals[c] : 0.0;
    sums_[c] += value - (full ? entry.residuals[c] : 0.0);
    entry.residuals[c] = value;
  }
  entry.normal = normal_factor >= models_->decision.isolation_threshold;
  normal_count_ += entry.normal ? 1 : 0;
  next_ = (next_ + 1) % ring_.size();
  filled_ = std::min(filled_ + 1, static_cast<int>(ring_.size()));
}

bool ClearingWindow::Cleared() const {
  const int length = static_cast<int>(ring_.size());
  if (quiet_ < length || filled_ < length ||
      normal_count_ < models_->decision.isolation_fraction * length) {
    return false;
  }
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const double mean = sums_[c] / length;
    if (mean < kMeanShare * models_->channels[c].lower_threshold ||
        mean > kMeanShare * models_->channels[c].upper_threshold) {
      return false;
    }
  }
  return true;
}

}  // namespace fdi
