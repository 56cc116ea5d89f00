#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/fault_texts.h"
#include "cli/json_output.h"
#include "diagnosis/concurrency/worker.h"
#include "diagnosis/log.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// Hands one text to the world outside.
class EventDelivery {
 public:
  virtual ~EventDelivery() = default;
  /// Waits until it was taken, or for the time limit. One thread.
  /// @returns why it was not taken, or nothing.
  virtual std::optional<std::string> Deliver(const std::string& json) = 0;
  /// Ends what is under way, and all that comes, at once. Thread safe.
  virtual void Interrupt() = 0;
};

/// Runs a program with the text as its standard input; status 0 is success.
/// No shell: `words` are the program, sought in PATH, and its arguments. It has
/// no other file of ours open, its output goes to our standard error, and it is
/// killed with all its children that stay in its process group after `limit`.
/// @throws std::system_error if the kernel has no file for us.
std::unique_ptr<EventDelivery> DeliverToProgram(
    std::vector<std::string> words, std::chrono::milliseconds limit);

/// POSTs the text as application/json; a status of 2xx is success.
/// @param url http://HOST[:PORT][/PATH]
/// @throws ConfigError naming `url` and what is accepted.
std::unique_ptr<EventDelivery> DeliverToUrl(const std::string& url,
                                            std::chrono::milliseconds limit);

/// One of the two: what begins with http:// is a URL, else a command whose
/// words are separated by blanks, with quotes around those that have some.
/// @throws ConfigError naming what is accepted.
std::unique_ptr<EventDelivery> MakeEventDelivery(
    const std::string& target, std::chrono::milliseconds limit);

/// Settings of EventHook.
struct EventHookOptions {
  int per_minute{60};  ///< Deliveries; so many at once.
  std::size_t max_waiting{256};
  std::function<std::chrono::steady_clock::time_point()> now{
      std::chrono::steady_clock::now};
};

/// {"kind", "valve_id", "episode_id", "stamp_utc", "fault", "name", "severity",
/// "discipline", "namur", "check", "factor", "strength", "reason", "model_set",
/// "persisted"}; null where there is none. What has no fault yet has neither
/// name nor check: that it is unlike all known faults is said once that is
/// known.
cli::Json EventJson(const FaultEvent& event, bool persisted,
                    const cli::FaultTexts& texts);

/// Notifies a program or a web server of every fault event that goes to the
/// bus, each at most once and in their order, by a thread of its own: neither
/// diagnosis nor bus wait.
///
/// Not more than `per_minute`: what comes beyond is left out but for the
/// newest, which is delivered once the rate allows it. What is delivered
/// carries "left_out", how many were not since the one before.
///
/// Built idle. Thread safe, but for Start() and Stop().
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

  /// Takes `event`, an object, for delivery. Never waits.
  void Notify(cli::Json event);

  void Start();
  /// Lets what is under way and what waits go on for at most `patience`; then
  /// ends the thread. Nothing if it was not started.
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
  std::uint64_t left_out_{0};        // Since the last one delivered.
  double tokens_;
  TimePoint filled_;
  bool busy_{false};
  bool stopping_{false};
  Counts counts_;
  Worker worker_;
};

/// In front of `bus`: a hook is notified of what went there.
class OutwardEvents : public EventSink {
 public:
  OutwardEvents(EventSink& bus, std::unique_ptr<EventDelivery> delivery,
                EventHookOptions options, cli::FaultTexts texts, LogSink log)
      : bus_(bus),
        texts_(std::move(texts)),
        hook_(std::move(delivery), std::move(options), std::move(log)) {}

  bool Publish(const FaultEvent& event, bool persisted) override {
    const bool sent = bus_.Publish(event, persisted);
    hook_.Notify(EventJson(event, persisted, texts_));
    return sent;
  }

  EventHook& hook() { return hook_; }

 private:
  EventSink& bus_;
  cli::FaultTexts texts_;
  EventHook hook_;
};

}  // namespace fdi::monitor
