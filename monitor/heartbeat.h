#pragma once

#include <atomic>
#include <chrono>
#include <string_view>
#include <vector>

namespace fdi::monitor {

/// A thread's sign of life: it beats whenever it has got on with its work, and
/// at least each second while there is none.
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

/// The threads that must get on for the monitor to be of use. The pulses
/// outlive this.
class Heartbeat {
 public:
  using TimePoint = Pulse::Clock::time_point;
  struct Member {
    std::string_view thread;  ///< "intake", ...
    const Pulse* pulse;
  };

  explicit Heartbeat(std::vector<Member> members)
      : members_(std::move(members)) {}

  const std::vector<Member>& members() const { return members_; }

  /// Threads that did not beat after `since`.
  std::vector<std::string_view> StalledSince(TimePoint since) const;

 private:
  std::vector<Member> members_;
};

/// When to tell a service manager that all is well: in each interval once, and
/// only if every thread got on since it was told last.
class Watchdog {
 public:
  using TimePoint = Heartbeat::TimePoint;
  using Interval = std::chrono::microseconds;

  /// @param interval between two signs; half of what the manager allows.
  Watchdog(const Heartbeat& heartbeat, Interval interval, TimePoint now)
      : heartbeat_(heartbeat), interval_(interval), told_(now) {}

  /// @returns whether to tell now; then it is taken as done.
  bool Tell(TimePoint now);

  /// When Tell() is to be asked again.
  TimePoint next() const { return told_ + interval_; }

 private:
  const Heartbeat& heartbeat_;
  Interval interval_;
  TimePoint told_;
};

}  // namespace fdi::monitor
