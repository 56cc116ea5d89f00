#include "diagnosis/isolation.h"

#include <algorithm>
#include <cmath>

namespace fdi {

IsolationWindow::IsolationWindow(const DecisionParameters& parameters)
    : length_(parameters.isolation_samples),
      needed_(static_cast<int>(std::ceil(parameters.isolation_fraction *
                                             parameters.isolation_samples -
                                         1e-9))),
      ring_(static_cast<std::size_t>(length_), 0),
      counts_(kMaxFaults, 0) {}

void IsolationWindow::Restart() {
  filled_ = 0;
  next_ = 0;
  std::fill(counts_.begin(), counts_.end(), 0);
}

void IsolationWindow::Push(FaultSet above_threshold) {
  FaultSet& slot = ring_[static_cast<std::size_t>(next_)];
  for (int i = 0; i < kMaxFaults; ++i) {
    int& count = counts_[static_cast<std::size_t>(i)];
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
  FaultSet supported = 0;
  if (filled_ < length_) {
    return supported;
  }
  for (int i = 0; i < kMaxFaults; ++i) {
    if (counts_[static_cast<std::size_t>(i)] >= needed_) {
      supported |= FaultSet{1} << i;
    }
  }
  return supported;
}

}  // namespace fdi
