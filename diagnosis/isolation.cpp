#include "diagnosis/isolation.h"

#include <algorithm>
#include <cmath>

namespace fdi {
namespace {

int CountOf(double fraction, int samples) {
  return static_cast<int>(std::ceil(fraction * samples - 1e-9));
}

}  // namespace

IsolationWindow::IsolationWindow(const DecisionParameters& parameters,
                                 std::size_t faults)
    : length_(parameters.isolation_samples),
      needed_(CountOf(parameters.isolation_fraction, length_)),
      joining_(CountOf(parameters.join_fraction, length_)),
      ring_(static_cast<std::size_t>(length_), 0),
      counts_(faults, 0) {}

void IsolationWindow::Restart() {
  filled_ = 0;
  next_ = 0;
  std::fill(counts_.begin(), counts_.end(), 0);
}

void IsolationWindow::Push(FaultSet above_threshold) {
  FaultSet& slot = ring_[static_cast<std::size_t>(next_)];
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    int& count = counts_[i];
    if (filled_ == length_) {
      count -= static_cast<int>(slot >> i & 1U);
    }
    count += static_cast<int>(above_threshold >> i & 1U);
  }
  slot = above_threshold;
  next_ = (next_ + 1) % length_;
  filled_ = std::min(filled_ + 1, length_);
}

FaultSet IsolationWindow::Supported() const {
  FaultSet supporting = 0;
  FaultSet joining = 0;
  if (filled_ < length_) {
    return 0;
  }
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    const int count = counts_[i];
    supporting |= count >= needed_ ? FaultSet{1} << i : 0;
    joining |= count >= joining_ ? FaultSet{1} << i : 0;
  }
  return supporting != 0 ? joining : 0;
}

}  // namespace fdi
