#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "monitor/bounded_queue.h"
#include "monitor/counters.h"
#include "monitor/episode_writer.h"
#include "monitor/heartbeat.h"
#include "monitor/sample_recorder.h"
#include "monitor/shadow_bank.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"
#include "monitor/valve_registry.h"

namespace fdi::monitor {

/// Settings of Pipeline.
struct PipelineOptions {
  int max_valves{2000};
  std::string valve_glob{"*"};
  std::size_t queue_samples{8192};  ///< Between intake and diagnosis.
  std::chrono::milliseconds checkpoint_period{60'000};
  RegistryOptions registry;
  EpisodeWriterOptions history;  ///< utc_now_ns is needed.
  SampleRecorderOptions recorder;
  ShadowOptions shadow;  ///< Without a candidate: none runs.
};

/// Where the results go; all outlive the pipeline.
struct PipelineSinks {
  DecisionSink& decisions;
  EventSink& events;
  HistorySink& history;
  SampleSink* samples{nullptr};  ///< Null: samples are not recorded.
  LiveSink* live{nullptr};       ///< Null: nobody looks.
};

/// From samples to decisions, events and records, on threads of its own:
///
///     intake (the caller) -> queue -> diagnosis -> decision vectors
///                                       |-> history thread -> outbox thread
///                                       \-> recorder thread
///
/// The queue never drops: full, Offer() waits, and the reader stops taking.
class Pipeline {
 public:
  Pipeline(PipelineOptions options, PipelineSinks sinks,
           std::shared_ptr<const ModelResolver> resolver, Counters& counters,
           ThrottledLog& log);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Begins to diagnose. @param open episodes that the last session left open.
  /// @param accumulators of valves, as the last session kept them.
  /// @param shadow_accumulators the same of the candidate.
  void Start(const std::vector<OpenEpisode>& open,
             std::vector<Accumulator> accumulators = {},
             std::vector<Accumulator> shadow_accumulators = {});

  /// A sample that was received. One intake thread. Waits while the queue is
  /// full. @param writer who sent it. @returns false once stopped. The
  /// diagnosis may sleep on, for at most 100 ms, until AnnounceOffers(): waking
  /// it for each of many samples costs more than diagnosing them.
  bool Offer(std::string_view valve_id, const Sample& sample,
             std::uint64_t writer);
  /// The publisher ended the stream of the valve. As Offer().
  bool OfferEnd(std::string_view valve_id, std::uint64_t writer);
  /// No sample follows at once. Intake thread.
  void AnnounceOffers() { queue_.Announce(); }

  /// Asks `resolver` for the models of all valves from now on. Between two
  /// samples: none is lost or diagnosed twice. Thread safe.
  void Reassign(std::shared_ptr<const ModelResolver> resolver);

  /// Diagnoses, stores and publishes what is in, then ends the threads.
  /// Episodes stay open: the next session goes on with them.
  void Stop();

  /// A thread died of an exception; Stop() and then Rethrow().
  bool failed() const { return failed_; }
  void Rethrow() const;

  ValveCensus census() const { return registry_.census(); }
  /// Of the candidate; null if none runs.
  const ShadowCounts* shadow_counts() const {
    return shadow_ ? &shadow_->counts() : nullptr;
  }
  std::vector<std::string> valve_names() const { return registry_.names(); }
  bool history_degraded() const { return writer_.degraded(); }
  bool recording_degraded() const { return recorder_ && recorder_->degraded(); }

  /// Items that wait for each thread.
  struct Backlog {
    std::size_t diagnosis{0};
    std::size_t recorder{0};
    EpisodeWriter::Backlog history;
  };
  Backlog backlog() const;

  /// Diagnosis, history and, if there is one, recorder.
  std::vector<Heartbeat::Member> threads() const;

 private:
  using TimePoint = ValveMonitor::TimePoint;
  struct Item {
    ValveDirectory::Entry valve;
    std::uint64_t writer;
    TimePoint received;
    bool ended;
    Sample sample;
  };

  std::optional<ValveDirectory::Entry> Admit(std::string_view valve_id);
  void Run();
  void Diagnose();
  void Handle(const Item& item);
  void HandleEnd(const Item& item);
  void Publish(const Item& item, const ValveOutcome& outcome);
  void CountRejection(const Item& item, Intake intake);
  void AdoptPendingResolver();
  void TakeCheckpoint();

  PipelineOptions options_;
  DecisionSink& decisions_;
  LiveSink* live_;
  Counters& counters_;
  ThrottledLog& log_;
  EpisodeWriter writer_;
  std::unique_ptr<SampleRecorder> recorder_;
  ValveDirectory directory_;
  ValveRegistry registry_;
  std::unique_ptr<ShadowBank> shadow_;
  BoundedQueue<Item> queue_;
  Pulse pulse_;
  TimePoint last_tend_;
  TimePoint last_checkpoint_;

  std::mutex resolver_mutex_;
  std::shared_ptr<const ModelResolver> next_resolver_;

  std::atomic<bool> failed_{false};
  std::exception_ptr error_;  // set before failed_
  std::thread thread_;
};

}  // namespace fdi::monitor
