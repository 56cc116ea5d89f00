#pragma once

#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <stop_token>

namespace fdi {

/// The loop of a thread that must not end the process: calls `work` until
/// `stop`. What it throws goes to `report`, and the next call comes a `pause`
/// later, or never if `stop` comes first. What `report` throws is ignored: it
/// may be the memory that is missing.
template <typename Work, typename Report>
void RetryUntil(const std::stop_token& stop, std::chrono::milliseconds pause,
                const Work& work, const Report& report) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  while (!stop.stop_requested()) {
    try {
      work();
    } catch (const std::exception& error) {
      try {
        report(error);
      } catch (const std::exception&) {
      }
      std::unique_lock lock(mutex);
      stopped.wait_for(lock, stop, pause, [] { return false; });
    }
  }
}

}  // namespace fdi
