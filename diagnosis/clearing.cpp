#include "diagnosis/clearing.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

constexpr double kMeanShare = 0.3;        // of the threshold
constexpr double kExcitationShare = 0.5;  // of that at the detection
// Samples of CV that tell how much it varies.
constexpr int kFewestCommands = 60;
constexpr int kMostCommands = 200;

}  // namespace

void CommandHistory::Push(double cv) {
  ring_[next_] = cv;
  next_ = (next_ + 1) % ring_.size();
  filled_ = std::min(filled_ + 1, ring_.size());
}

double CommandHistory::deviation() const {
  const auto count = static_cast<double>(filled_);
  double mean = 0.0;
  for (std::size_t i = 0; i < filled_; ++i) {
    mean += ring_[i] / count;
  }
  double variance = 0.0;
  for (std::size_t i = 0; i < filled_; ++i) {
    variance += (ring_[i] - mean) * (ring_[i] - mean) / count;
  }
  return std::sqrt(variance);
}

double CommandHistory::range() const {
  if (filled_ == 0) {
    return 0.0;
  }
  const auto [lowest, highest] = std::minmax_element(
      ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(filled_));
  return *highest - *lowest;
}

ClearingWindow::ClearingWindow(const ModelSet& models)
    : models_(&models),
      commands_(std::clamp(models.decision.clearing_samples, kFewestCommands,
                           kMostCommands)),
      ring_(static_cast<std::size_t>(models.decision.clearing_samples)) {}

void ClearingWindow::Observe(double cv) {
  cv_ = cv;
  commands_.Push(cv);
}

void ClearingWindow::Restart() {
  deviation_then_ = commands_.deviation();
  range_then_ = commands_.range();
  lowest_ = cv_;
  highest_ = cv_;
  quiet_ = 0;
  filled_ = 0;
  next_ = 0;
  normal_count_ = 0;
  sums_.fill(0.0);
}

void ClearingWindow::Push(std::span<const double> residuals,
                          double normal_factor, bool abnormal) {
  quiet_ = abnormal ? 0 : quiet_ + 1;
  lowest_ = abnormal ? cv_ : std::min(lowest_, cv_);
  highest_ = abnormal ? cv_ : std::max(highest_, cv_);
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

bool ClearingWindow::Excited() const {
  return highest_ - lowest_ >= range_then_ ||
         commands_.deviation() >= kExcitationShare * deviation_then_;
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
  return Excited();
}

}  // namespace fdi
