#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <future>
#include <optional>
#include <stop_token>

#include "base/mutex.h"
#include "base/worker.h"
#include "diagnosis/loop/audit.h"

namespace fdi::monitor {

/// Audits windows of loops on a thread of its own, at low priority and in the
/// order in which they came: an audit takes some milliseconds, which the
/// samples do not wait for. A few windows may wait; what does not fit is
/// refused, and its loop asks again.
///
/// Built idle. Thread safe, but for Start() and Stop().
class AuditWorker {
 public:
  /// 17 kB each.
  static constexpr std::size_t kCapacity = 256;

  /// @param beside_models also valves with a model set are to be audited.
  explicit AuditWorker(bool beside_models = false)
      : beside_models_(beside_models) {}
  ~AuditWorker() { stop_.request_stop(); }
  AuditWorker(const AuditWorker&) = delete;
  AuditWorker& operator=(const AuditWorker&) = delete;

  bool beside_models() const { return beside_models_; }

  /// True if a window would be taken now; one thread that asks and submits can
  /// rely on it.
  bool has_room() const {
    const MutexLock lock(mutex_);
    return waiting_.size() < kCapacity;
  }
  /// An audit that fails, or is given up at a stop, is answered with nothing.
  std::future<std::optional<loop::Audit>> Submit(loop::Window window);

  /// Windows wait, or one is being audited.
  bool busy() const {
    const MutexLock lock(mutex_);
    return working_ || !waiting_.empty();
  }

  void Start();
  /// Ends the thread after the window at hand; waiting ones are given up.
  void Stop();
  /// The thread ended with an exception, which Stop() throws. Any thread.
  bool failed() const { return thread_.failed(); }

 private:
  struct Task {
    loop::Window window;
    std::promise<std::optional<loop::Audit>> answer{};
  };

  void Work();

  bool beside_models_;
  std::stop_source stop_;
  mutable Mutex mutex_;
  std::condition_variable_any arrival_;
  std::deque<Task> waiting_ GUARDED_BY(mutex_);
  bool working_ GUARDED_BY(mutex_){false};
  Worker thread_;  // Last: it uses what is above.
};

}  // namespace fdi::monitor
