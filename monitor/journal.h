#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <variant>
#include <vector>

#include "base/mutex.h"
#include "base/worker.h"
#include "monitor/checkpoint.h"
#include "monitor/counters.h"
#include "monitor/episode_tracker.h"
#include "monitor/heartbeat.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Settings of Journal.
struct JournalOptions {
  std::chrono::milliseconds patience{200};  ///< Maximum wait for a commit.
  std::chrono::milliseconds commit_period{1000};
  std::chrono::milliseconds retry_period{1000};
  std::chrono::milliseconds stop_limit{1000};  ///< For evidence at shutdown.
  int tries{3};  ///< Before a record that fails for its own sake is left out.
  /// Queued events, gaps and marks; and events that wait for the bus.
  std::size_t max_records{100'000};
  std::size_t max_trace_points{2'000'000};  ///< Queued evidence.
  /// True if all current subscribers acknowledge, within the timeout, what was
  /// published.
  std::function<bool(std::chrono::milliseconds)> acknowledged{
      [](std::chrono::milliseconds) { return true; }};
  /// Minimum time for which a published event may be sent again, because new
  /// subscribers may still be discovering us; it also has to be acknowledged.
  std::chrono::milliseconds delivery_time{10'000};
  std::size_t max_undelivered{
      10'000};  ///< Beyond it the oldest is marked as sent.
};

/// Passes fault events to the history and then to the bus, and evidence, gaps
/// and checkpoints to the history. Never blocks the diagnosis.
///
/// A published event is marked as sent once subscribers have acknowledged it;
/// unmarked events are republished by the next session.
///
/// Two threads, because the duration of a commit is unbounded: the history
/// thread commits in batches, events before evidence; the publisher publishes
/// the events in order, each as soon as it is committed, or as not persisted if
/// the commit failed or took longer than 200 ms.
///
/// If the history fails, everything is kept and retried every second; what
/// exceeds the queues is counted as lost, and the outage becomes a data gap
/// once the history has recovered. A record that fails for its own sake
/// (RecordError) is tried three times, a second apart, while the others go on;
/// then it is set aside: counted, logged, and noted as a gap of its valve.
///
/// Built idle. Thread safe except for Start() and Stop().
class Journal : public EpisodeOutlet {
 public:
  Journal(HistorySink& history, EventSink& bus, const MonitorContext& context,
          const JournalOptions& options);
  ~Journal() override;
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  void OnEvent(FaultEvent event) override;
  void OnEvidence(EpisodeTrace trace) override;
  void OnLook(EpisodeLook look) override;
  void OnStrength(StrengthPoint point) override;
  void OnGap(DataGap gap) override;
  void OnNormal(const std::string& valve_id, std::int64_t stamp_ns) override;
  void OnSilence(const std::string& valve_id,
                 std::optional<std::int64_t> since_ns) override;
  void OnResumed(const OpenEpisode& episode, std::int64_t stamp_ns) override;
  /// `event` was published before Start(): marks it as sent once that is due.
  void MarkPublished(const FaultEvent& event);
  /// Commits `checkpoint`, merged with one that is still waiting.
  void Commit(Checkpoint checkpoint);

  void Start();
  /// Commits and publishes the queue and ends the threads; does nothing if
  /// they were not started. @throws the exception that ended a thread.
  void Stop();

  /// A thread ended with an exception.
  bool failed() const { return writer_.failed() || publisher_.failed(); }
  /// The history is failing at present.
  bool degraded() const { return degraded_; }
  /// Beaten by the history thread.
  const Pulse& pulse() const { return pulse_; }

  /// Records queued for the history.
  struct Backlog {
    std::size_t records{0};
    std::size_t trace_points{0};
  };
  Backlog backlog() const;

 private:
  using Clock = std::chrono::steady_clock;

  // An event that has not been published, or not been marked as such.
  struct Pending {
    enum class Stage : std::uint8_t { kWaiting, kCommitted, kFailed };
    FaultEvent event;
    Clock::time_point deadline;
    Stage stage{Stage::kWaiting};
    Clock::time_point published{};
  };
  using PendingEvent = std::shared_ptr<Pending>;
  struct Resumption {
    std::uint64_t episode_id;
    std::int64_t stamp_ns;
    std::string valve_id;
  };
  struct Normal {
    std::string valve_id;
    std::int64_t stamp_ns;
  };
  struct Silent {
    std::string valve_id;
    std::optional<std::int64_t> since_ns;
  };
  struct Sent {  // The event is on the bus.
    PendingEvent pending;
  };
  using Record = std::variant<PendingEvent, Resumption, EpisodeLook,
                              StrengthPoint, Normal, Silent, DataGap, Sent>;

  struct Deferred {  // Failed for its own sake so many times.
    Record record;
    int failures;
  };

  // Used by callers.
  bool AddLocked(Record record) REQUIRES(mutex_);
  void SetStageLocked(Pending& pending, bool committed) REQUIRES(mutex_);

  // Used by the history thread.
  void Write();
  bool WriteWaiting();
  bool WriteRecords();
  void ReportRefused(const FaultEvent& event);
  bool Buffer(const std::vector<const Record*>& batch);
  bool WriteBatch(std::vector<const Record*> batch, int failures = 0);
  bool Store(const Record& record);
  bool RetryDeferred();
  void SetAside(const Record& record, const std::string& reason);
  bool WriteCheckpoint();
  bool WriteTraces();
  bool HasQueuedEvent() const;
  bool CommitBuffered();
  bool Attempt(const std::function<void()>& call);
  bool AttemptOrDrop(const std::function<void()>& call, int& failures,
                     const std::function<void()>& drop);
  void FailWaitingEvents();
  void Recovered();

  // Used by the publisher.
  void PublishAll();
  void Publish(const PendingEvent& pending, bool persisted);
  void MarkDelivered(Clock::time_point limit,
                     std::chrono::milliseconds patience);

  HistorySink& history_;
  EventSink& bus_;
  MonitorContext context_;
  Counters& counters_;
  ThrottledLog& log_;
  JournalOptions options_;
  Pulse pulse_;
  std::atomic<bool> degraded_{false};
  // Used by the history thread only.
  std::int64_t degraded_since_ns_{0};
  Clock::time_point last_commit_;
  std::vector<Deferred> deferred_;
  Clock::time_point retry_deferred_at_;
  int buffered_failures_{0};
  int checkpoint_failures_{0};

  mutable Mutex mutex_;
  CondVar work_;            // For the history thread,
  CondVar unsent_changed_;  // for the publisher.
  std::deque<Record> records_ GUARDED_BY(mutex_);
  std::deque<PendingEvent> unsent_ GUARDED_BY(mutex_);
  std::deque<PendingEvent> undelivered_
      GUARDED_BY(mutex_);  // Published; oldest first.
  std::deque<EpisodeTrace> traces_ GUARDED_BY(mutex_);
  std::size_t trace_points_ GUARDED_BY(mutex_){0};
  Checkpoint checkpoint_ GUARDED_BY(mutex_);
  bool stopping_ GUARDED_BY(mutex_){false};
  bool publishing_ends_ GUARDED_BY(mutex_){false};
  Clock::time_point stop_by_ GUARDED_BY(mutex_);

  Worker writer_;
  Worker publisher_;
};

}  // namespace fdi::monitor
