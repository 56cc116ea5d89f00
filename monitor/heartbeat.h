#pragma once

#include <atomic>
#include <chrono>
#include <string_view>
#include <utility>
#include <vector>

namespace fdi::monitor {

/// A thread's sign of life: it beats whenever it makes progress, and at least
/// once a second while it is idle.
///
/// Thread safe.
class Pulse {
 public:
  using Clock = std::chrono::steady_clock;

  void Beat() noexcept {
    last_.store(Clock::now().time_since_epoch(), std::memory_order_relaxed);
  }
  Clock::time_point last() const noexcept {
    return Clock::time_point(last_.load(std::memory_order_relaxed));
  }

 private:
  std::atomic<Clock::duration> last_{Clock::now().time_since_epoch()};
};

/// The threads that must make progress for the monitor to be useful. The pulses
/// outlive this.
class Heartbeat {
 public:
  using TimePoint = Pulse::Clock::time_point;
  struct Member {
    std::string_view thread;  ///< "diagnosis", ...
    const Pulse* pulse;
  };

  explicit Heartbeat(std::vector<Member> members)
      : members_(std::move(members)) {}

  const std::vector<Member>& members() const { return members_; }

  /// Threads that did not beat after `since`.
  std::vector<std::string_view> StalledSince(TimePoint since) const {
    std::vector<std::string_view> stalled;
    for (const Member& member : members_) {
      if (member.pulse->last() <= since) {
        stalled.push_back(member.thread);
      }
    }
    return stalled;
  }

 private:
  std::vector<Member> members_;
};

/// Decides when to notify a service manager that all is well: once per
/// interval, and only if every thread made progress since the last
/// notification.
class Watchdog {
 public:
  using TimePoint = Heartbeat::TimePoint;
  using Interval = std::chrono::microseconds;

  /// @param interval half of the timeout that the manager allows.
  Watchdog(const Heartbeat& heartbeat, Interval interval, TimePoint now)
      : heartbeat_(heartbeat), interval_(interval), notified_(now) {}

  /// @returns whether to notify now, which is then taken as done.
  bool Due(TimePoint now) {
    if (now < next() || !heartbeat_.StalledSince(notified_).empty()) {
      return false;
    }
    notified_ = now;
    return true;
  }

  /// When to call Due() next.
  TimePoint next() const { return notified_ + interval_; }

 private:
  const Heartbeat& heartbeat_;
  Interval interval_;
  TimePoint notified_;
};

}  // namespace fdi::monitor
