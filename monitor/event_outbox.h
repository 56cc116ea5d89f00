#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "monitor/counters.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// A fault event on its way to the bus, which it may not enter before it is
/// stored, or storing failed, or patience ended.
class PendingEvent {
 public:
  using Clock = std::chrono::steady_clock;

  PendingEvent(EpisodeEvent the_event, Clock::time_point until)
      : event(std::move(the_event)), deadline(until) {}

  const EpisodeEvent event;
  const Clock::time_point deadline;

 private:
  friend class EventOutbox;
  enum class Stage : std::uint8_t { kWaiting, kStored, kFailed };
  Stage stage_{Stage::kWaiting};
};

/// Publishes fault events in their order, each as soon as it is stored, at the
/// latest 200 ms after it was added, by a thread of its own.
///
/// Thread safe.
class EventOutbox {
 public:
  /// @param on_sent is called by the outbox thread for what is on the bus.
  EventOutbox(EventSink& sink, Counters& counters, ThrottledLog& log,
              std::chrono::milliseconds patience,
              std::function<void(const EpisodeEvent&)> on_sent);
  ~EventOutbox();
  EventOutbox(const EventOutbox&) = delete;
  EventOutbox& operator=(const EventOutbox&) = delete;

  std::shared_ptr<PendingEvent> Add(EpisodeEvent event);
  void Settle(PendingEvent& pending, bool stored);

  /// Publishes what is left, waiting for none of it, and ends the thread.
  void Stop();

 private:
  void Run();
  void Publish(const PendingEvent& pending, bool persisted);

  EventSink& sink_;
  Counters& counters_;
  ThrottledLog& log_;
  std::chrono::milliseconds patience_;
  std::function<void(const EpisodeEvent&)> on_sent_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<PendingEvent>> pending_;
  bool stopping_{false};
  std::thread thread_;
};

}  // namespace fdi::monitor
