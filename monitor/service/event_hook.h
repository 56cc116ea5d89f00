#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/log.h"
#include "base/mutex.h"
#include "base/worker.h"
#include "diagnosis/model/valve_identity.h"
#include "diagnosis/records/fault_event.h"
#include "report/fault_texts.h"
#include "report/json_output.h"
#include "storage/history/alarm.h"

namespace fdi::monitor {

/// Delivers one text to an external receiver.
class EventDelivery {
 public:
  virtual ~EventDelivery() = default;
  /// Waits until the text was accepted, or the timeout. Called by one thread.
  /// @returns why it was not accepted, or nothing on success.
  virtual std::optional<std::string> Deliver(const std::string& json) = 0;
  /// Aborts the delivery in progress and all later ones. Thread safe.
  virtual void Interrupt() = 0;
};

/// Runs a program with the text as its standard input; exit status 0 is
/// success. There is no shell: `words` are the program, looked up in PATH, and
/// its arguments. It inherits no other open file, writes to our standard error,
/// and is killed after `limit` together with the children in its process group.
/// @throws std::system_error if no event file descriptor can be created.
std::unique_ptr<EventDelivery> DeliverToProgram(
    std::vector<std::string> words, std::chrono::milliseconds limit);

/// DeliverToProgram() with the words of a command, which are separated by
/// blanks; words that contain blanks are quoted.
/// @throws ConfigError naming what is accepted.
std::unique_ptr<EventDelivery> MakeEventDelivery(
    const std::string& target, std::chrono::milliseconds limit);

/// Settings of EventHook.
struct EventHookOptions {
  int per_minute{60};  ///< Rate and burst size of deliveries.
  std::size_t max_waiting{256};
  std::function<std::chrono::steady_clock::time_point()> now{
      std::chrono::steady_clock::now};
};

/// {"kind", "valve_id", "about", "episode_id", "stamp_utc", "fault", "name",
/// "certainty", "severity", "priority", "discipline", "namur", "check",
/// "factor", "strength", "reason", "model_set", "persisted", "shelved"};
/// missing values are null. Without a fault, strength, name and check are null
/// too, the last two until the event is known to lie outside all known faults.
/// @param shelves those in force; "shelved" says whether one covers the event.
/// @param about the valve: "about" is findings::AboutJson().
report::Json EventJson(const FaultEvent& event, bool persisted,
                       const report::FaultTexts& texts,
                       const std::vector<storage::Shelf>& shelves = {},
                       const ValveIdentity& about = {});

/// Notifies a program of every fault event that goes to the
/// bus, each at most once and in order, from a thread of its own: neither the
/// diagnosis nor the bus waits.
///
/// The rate is limited to `per_minute`. Only the newest of the events beyond it
/// is kept, and delivered once the rate allows it. Each delivery carries
/// "left_out", the number of events dropped since the previous one.
///
/// Built idle. Thread safe except for Start() and Stop().
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

  /// Queues `event`, a JSON object, for delivery. Never blocks.
  void Notify(report::Json event);

  void Start();
  /// Allows `patience` for the deliveries in progress and in the queue, then
  /// ends the thread. Does nothing if it was not started.
  void Stop(std::chrono::milliseconds patience);

  Counts counts() const;

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  void Run();
  bool TakeToken(TimePoint now) REQUIRES(mutex_);
  void Enqueue(report::Json event) REQUIRES(mutex_);
  void RecordResult(const std::optional<std::string>& failure) REQUIRES(mutex_);

  std::unique_ptr<EventDelivery> delivery_;
  EventHookOptions options_;
  LogSink log_;

  mutable Mutex mutex_;
  CondVar changed_;
  std::deque<report::Json> waiting_ GUARDED_BY(mutex_);    // Within the rate.
  std::optional<report::Json> newest_ GUARDED_BY(mutex_);  // Beyond it.
  std::uint64_t left_out_ GUARDED_BY(mutex_){
      0};  // Since the last one delivered.
  double tokens_ GUARDED_BY(mutex_);
  TimePoint filled_ GUARDED_BY(mutex_);
  bool busy_ GUARDED_BY(mutex_){false};
  bool stopping_ GUARDED_BY(mutex_){false};
  Counts counts_ GUARDED_BY(mutex_);
  Worker worker_;
};

}  // namespace fdi::monitor
