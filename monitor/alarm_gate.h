#pragma once

#include <memory>
#include <utility>

#include "base/mutex.h"
#include "diagnosis/decision/alarm_budget.h"

namespace fdi::monitor {

/// The budget of alarms as it is now; it is made anew as hours come. Thread
/// safe.
class AlarmGate {
 public:
  void Set(std::shared_ptr<const AlarmBudget> budget) {
    const MutexLock lock(mutex_);
    budget_ = std::move(budget);
  }
  /// Null: every episode is an alarm.
  std::shared_ptr<const AlarmBudget> Get() const {
    const MutexLock lock(mutex_);
    return budget_;
  }

 private:
  mutable Mutex mutex_;
  std::shared_ptr<const AlarmBudget> budget_ GUARDED_BY(mutex_);
};

}  // namespace fdi::monitor
