#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "idl/deadline.h"

namespace fdi::idl {

/// How many remote endpoints are matched; set by a callback, waited for by
/// others.
class Matched {
 public:
  void Set(int count) {
    {
      const std::lock_guard lock(mutex_);
      count_.store(count);
    }
    changed_.notify_all();
  }

  int count() const { return count_.load(); }

  bool WaitFor(int count, std::chrono::milliseconds timeout) const {
    std::unique_lock lock(mutex_);
    return changed_.wait_until(lock, DeadlineIn(timeout),
                               [&] { return count_.load() >= count; });
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::atomic<int> count_{0};
};

}  // namespace fdi::idl
