#pragma once

#include <mutex>
#include <string_view>

#include "trainer/training.h"

namespace fdi::trainer {

/// Hands progress to its receiver one call at a time. Thread safe.
class Reporter {
 public:
  /// `progress` must outlive the reporter; it may be empty.
  explicit Reporter(const Progress& progress) : progress_(progress) {}

  void Tell(double share, std::string_view stage) {
    const std::scoped_lock lock(mutex_);
    if (progress_) {
      progress_(share, stage);
    }
  }

 private:
  const Progress& progress_;
  std::mutex mutex_;
};

}  // namespace fdi::trainer
