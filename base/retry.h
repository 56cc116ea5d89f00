#pragma once

#include <chrono>
#include <condition_variable>
#include <exception>
#include <stop_token>

#include "base/mutex.h"

namespace fdi {

/// Waits for `pause`, or until `stop` if that comes first.
inline void PauseUntil(const std::stop_token& stop,
                       std::chrono::milliseconds pause) {
  Mutex mutex;
  std::condition_variable_any stopped;
  MutexLock lock(mutex);
  stopped.wait_for(lock, stop, pause, [] { return false; });
}

/// The loop of a thread that must not end the process: calls `work` until
/// `stop`. What it throws goes to `report`, and the next call comes a `pause`
/// later, or never if `stop` comes first. What `report` throws is ignored: it
/// may be the memory that is missing.
template <typename Work, typename Report>
void RetryUntil(const std::stop_token& stop, std::chrono::milliseconds pause,
                const Work& work, const Report& report) {
  while (!stop.stop_requested()) {
    try {
      work();
    } catch (const std::exception& error) {
      try {
        report(error);
      } catch (const std::exception&) {
      }
      PauseUntil(stop, pause);
    }
  }
}

}  // namespace fdi
