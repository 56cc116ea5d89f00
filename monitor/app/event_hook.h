#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "diagnosis/log.h"
#include "monitor/app/event_delivery.h"
#include "monitor/sinks.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/json_output.h"

namespace fdi::monitor {

/// Settings of EventHook.
struct EventHookOptions {
  int per_minute{60};  ///< Deliveries; so many at once.
  /// Deliveries under way at a time; more than one lose the order of events.
  int threads{1};
  std::size_t max_waiting{256};
  std::function<std::chrono::steady_clock::time_point()> now{
      std::chrono::steady_clock::now};
};

/// {"kind", "valve", "episode", "stamp_ms", "state", "fault", "name",
/// "severity", "discipline", "namur", "check", "factor", "strength", "reason",
/// "model_set", "persisted"}; null where there is none.
cli::Json EventJson(const EpisodeEvent& event, bool persisted,
                    const cli::FaultTexts& texts);

/// Tells a program or a web server of every fault event that goes to the bus,
/// each at most once, by threads of its own: neither diagnosis nor bus wait.
///
/// Not more than `per_minute`: what comes beyond is left out but for the
/// newest, which is told once the rate allows it. What is told carries
/// "left_out", how many were not since the one before.
///
/// Thread safe.
class EventHook {
 public:
  struct Counts {
    std::uint64_t delivered{0};
    std::uint64_t failed{0};
    std::uint64_t left_out{0};
  };

  EventHook(std::unique_ptr<EventDelivery> delivery, EventHookOptions options,
            LogSink log);
  ~EventHook();
  EventHook(const EventHook&) = delete;
  EventHook& operator=(const EventHook&) = delete;

  /// Tells `event`, an object. Never waits.
  void Tell(cli::Json event);

  /// Lets what is under way and what waits go on for at most `patience`; then
  /// ends the threads.
  void Stop(std::chrono::milliseconds patience);

  Counts counts() const;

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  void Run();
  bool TakeToken(TimePoint now);
  void Admit(cli::Json event);
  void Settle(const std::optional<std::string>& failure);

  std::unique_ptr<EventDelivery> delivery_;
  EventHookOptions options_;
  LogSink log_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<cli::Json> waiting_;    // Within the rate.
  std::optional<cli::Json> newest_;  // Beyond it.
  std::uint64_t left_out_{0};        // Since the last that was told.
  double tokens_;
  TimePoint filled_;
  int busy_{0};
  bool stopping_{false};
  Counts counts_;
  std::vector<std::thread> threads_;
};

/// In front of `bus`: a hook is told what went there.
class OutwardEvents : public EventSink {
 public:
  OutwardEvents(EventSink& bus, std::unique_ptr<EventDelivery> delivery,
                EventHookOptions options, cli::FaultTexts texts, LogSink log)
      : bus_(bus),
        texts_(std::move(texts)),
        hook_(std::move(delivery), std::move(options), std::move(log)) {}

  bool Publish(const EpisodeEvent& event, bool persisted) override {
    const bool sent = bus_.Publish(event, persisted);
    hook_.Tell(EventJson(event, persisted, texts_));
    return sent;
  }

  EventHook& hook() { return hook_; }

 private:
  EventSink& bus_;
  cli::FaultTexts texts_;
  EventHook hook_;
};

}  // namespace fdi::monitor
