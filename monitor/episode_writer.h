#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <variant>
#include <vector>

#include "monitor/counters.h"
#include "monitor/episode_tracker.h"
#include "monitor/event_outbox.h"
#include "monitor/heartbeat.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Settings of EpisodeWriter.
struct EpisodeWriterOptions {
  std::chrono::milliseconds patience{200};  ///< Of the bus for the disk.
  std::chrono::milliseconds commit_period{1000};
  std::chrono::milliseconds retry_period{1000};
  std::chrono::milliseconds stop_limit{1000};  ///< Of evidence at the end.
  std::size_t max_records{100'000};         ///< Events, gaps and marks waiting.
  std::size_t max_trace_points{2'000'000};  ///< Evidence waiting.
  std::function<std::int64_t()> utc_now_ns;  ///< Needed.
};

/// Stores episodes by a thread of its own, events before evidence, and gives
/// each event to the bus once it is stored; events that wait together are
/// stored in one commit. Never blocks the diagnosis.
///
/// If the history fails, events are published as not persisted, and all is
/// kept and tried again each second; what no longer fits is counted as lost,
/// and the time becomes a data gap once the history answers again.
///
/// Thread safe.
class EpisodeWriter : public EpisodeOutlet {
 public:
  EpisodeWriter(HistorySink& history, EventSink& bus, Counters& counters,
                ThrottledLog& log, EpisodeWriterOptions options);
  ~EpisodeWriter() override;
  EpisodeWriter(const EpisodeWriter&) = delete;
  EpisodeWriter& operator=(const EpisodeWriter&) = delete;

  void Event(EpisodeEvent event) override;
  void Evidence(EpisodeTrace trace) override;
  void Gap(DataGap gap) override;
  void Resumed(const OpenEpisode& episode, std::int64_t stamp_ns) override;

  /// Keeps `checkpoint`, on top of one that is still waiting.
  void Keep(Checkpoint checkpoint);

  /// Stores and publishes what is there and ends the threads.
  void Stop();

  /// The history fails at present.
  bool degraded() const { return degraded_; }

  /// Of the history thread.
  const Pulse& pulse() const { return pulse_; }

  /// What waits for the history.
  struct Backlog {
    std::size_t records{0};
    std::size_t trace_points{0};
  };
  Backlog backlog() const;

 private:
  // Few and large transactions: the newest chunk of a trace is packed anew in
  // each of them.
  static constexpr std::size_t kPointsPerCommit = 5'000;

  struct Resumption {
    std::uint64_t episode_id;
    std::int64_t stamp_ns;
  };
  struct Sent {
    EpisodeEvent event;
  };
  using Record =
      std::variant<std::shared_ptr<PendingEvent>, DataGap, Resumption, Sent>;

  bool Enqueue(Record record);
  void Run();
  bool Serve();
  bool WriteWaiting();
  bool WriteRecords();
  bool WriteBatch(const std::vector<const Record*>& batch);
  bool WriteTraces();
  bool WriteCheckpoint();
  void WriteStep(const Record& record);
  void Buffer(const Record& record);
  bool Attempt(const std::function<void()>& call);
  bool Commit();
  void FailWaitingEvents();
  void Recovered();

  HistorySink& history_;
  Counters& counters_;
  ThrottledLog& log_;
  EpisodeWriterOptions options_;
  std::atomic<bool> degraded_{false};
  std::int64_t degraded_since_ns_{0};
  std::chrono::steady_clock::time_point last_commit_;

  Pulse pulse_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Record> records_;
  std::deque<EpisodeTrace> traces_;
  Checkpoint checkpoint_;
  std::size_t trace_points_{0};
  bool stopping_{false};
  std::chrono::steady_clock::time_point stop_by_;
  EventOutbox outbox_;
  std::thread thread_;
};

}  // namespace fdi::monitor
