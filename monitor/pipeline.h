#pragma once

#include <bitset>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "diagnosis/followed_drift.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/journal.h"
#include "monitor/look_worker.h"
#include "monitor/recorder.h"
#include "monitor/shadow.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"
#include "monitor/valve_monitor.h"

namespace fdi::monitor {

/// Settings of Pipeline.
struct PipelineOptions {
  int max_valves{2000};
  /// A stranger that is silent for so long gives its place up when another
  /// valve needs it: one that no model set is assigned to by its id, and that
  /// the last session did not have. At once if its publisher ended the stream.
  std::chrono::milliseconds place_timeout{60'000};
  std::string valve_glob{"*"};
  TraceOptions trace;
  std::chrono::milliseconds stale_timeout{3'600'000};  ///< Ends an episode.
  /// A valve that stays silent for so long after the start gives up the
  /// episode that the last session left open.
  std::chrono::milliseconds recovery_window{60'000};
  std::chrono::milliseconds checkpoint_period{60'000};
  JournalOptions journal;
  RecorderOptions recorder;
  ShadowOptions shadow;    ///< Without a candidate: none runs.
  bool second_look{true};  ///< By physics, where the model set has them.
};

/// Where the results go; all outlive the pipeline.
struct PipelineSinks {
  DecisionSink& decisions;
  EventSink& events;
  HistorySink& history;
  SampleSink* samples{nullptr};  ///< Null: samples are not recorded.
  LiveSink* live{nullptr};       ///< Null: nobody looks.
};

/// How the valves are now.
struct ValveCensus {
  std::uint64_t valves{0};
  std::uint64_t unassigned{0};
  std::uint64_t stale{0};
  std::uint64_t ended{0};
  std::uint64_t open_episodes{0};
  std::uint64_t trace_bytes{0};
  std::uint64_t judged{0};      ///< Not silent, with a model set, and settled.
  std::uint64_t near_bound{0};  ///< Drifted that far (kNearBound).
};

/// From samples to decisions, events and records. The thread that takes samples
/// from the bus, the diagnosis thread, diagnoses them, too: what it is behind
/// with waits at the subscriber, which then stops receiving, so nothing is
/// dropped and no thread only moves samples.
///
///     diagnosis thread: Offer() -> engine -> decision vectors
///                                    |-> Journal: history thread, publisher
///                                    |-> Recorder: recorder thread
///                                    \-> LookWorker, which answers later
///
/// Built idle; Start() starts the threads of these. All calls come from the
/// diagnosis thread, Start() and Stop() while there is none, except where
/// noted.
class Pipeline {
 public:
  using TimePoint = ValveMonitor::TimePoint;

  Pipeline(PipelineOptions options, PipelineSinks sinks,
           std::shared_ptr<const ModelResolver> resolver,
           const MonitorContext& context);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// @param open episodes that the last session left open.
  /// @param accumulators of valves, as of the last session's last checkpoint.
  /// @param shadow_accumulators the same of the candidate.
  void Start(const std::vector<OpenEpisode>& open,
             std::vector<Accumulator> accumulators = {},
             std::vector<Accumulator> shadow_accumulators = {});

  /// `event`, of an earlier session, was published. Before Start().
  void Published(const FaultEvent& event) { journal_.Published(event); }

  /// A sample that was received. @param writer who sent it.
  void Offer(std::string_view valve_id, const Sample& sample,
             std::uint64_t writer,
             TimePoint received = std::chrono::steady_clock::now());
  /// Another monitor of the same valves raised an event that this one did not:
  /// it is recorded, and an episode that is open there goes on here.
  void Adopt(FaultEvent event);
  /// Nothing is judged of this valve yet, or not again.
  bool IsSettling(const std::string& valve_id) const;
  /// The publisher ended the stream of the valve.
  void OfferEnd(std::string_view valve_id, std::uint64_t writer);

  /// Does what is due beside samples: silent valves, checkpoints, newcomers on
  /// the bus, another assignment. To be called ten times a second or so, by a
  /// busy thread as well. @param now all samples received before were offered.
  void Tend(TimePoint now = std::chrono::steady_clock::now());
  /// Sends the decision vectors that the sink kept back, as Tend() does.
  void FlushDecisions();

  /// Asks `resolver` for the models of all valves from the next Tend() on:
  /// between two samples, none is lost or diagnosed twice. Thread safe.
  void Reassign(std::shared_ptr<const ModelResolver> resolver);

  /// Stores and publishes what is there, then ends the threads; nothing if they
  /// were not started. Episodes stay open: the next session goes on with them.
  /// @throws what a thread ended with.
  void Stop();

  /// What follows is thread safe.

  /// A thread died of an exception, which Stop() throws.
  bool failed() const {
    return journal_.failed() || (recorder_ && recorder_->failed()) ||
           (looks_ && looks_->failed());
  }
  ValveCensus census() const;                    ///< As of the last Tend().
  std::vector<std::string> valve_names() const;  ///< Of all valves seen.
  /// Of the candidate; null if none runs.
  const ShadowCounts* shadow_counts() const {
    return shadow_ ? &shadow_->counts() : nullptr;
  }
  bool history_degraded() const { return journal_.degraded(); }
  bool recording_degraded() const { return recorder_ && recorder_->degraded(); }
  Journal::Backlog journal_backlog() const { return journal_.backlog(); }
  std::size_t recorder_backlog() const {
    return recorder_ ? recorder_->waiting() : 0;
  }
  /// Diagnosis, history and, if there is one, recorder.
  std::vector<Heartbeat::Member> threads() const;

 private:
  struct Valve {
    ValveMonitor monitor;
    ShadowValve* shadow;  // Null: not compared.
    bool known;           // Keeps its place.
    // Limits that follow the valve no further: two of each channel.
    std::bitset<2 * kMaxChannels> drift_full{};
    double drift_used{0.0};  // Of the bounds, at most.
  };
  struct Hash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const {
      return std::hash<std::string_view>{}(text);
    }
  };

  Valve* Admit(std::string_view valve_id);
  Valve* Refuse(std::string_view valve_id, const char* reason);
  void Reserve(const std::string& valve_id);
  bool FreePlace(bool for_known);
  void GiveUp(Valve& valve);
  bool MayGiveUp(const Valve& valve) const;
  Valve& AddValve(std::string_view valve_id);
  bool Resolve(const std::string& valve_id, std::optional<EngineParts>& parts);
  void Count(const Valve& valve, const Sample& sample,
             const ValveOutcome& outcome);
  void Publish(const Valve& valve, const ValveOutcome& outcome);
  void Recover(const std::vector<OpenEpisode>& episodes);
  void AdoptNextResolver();
  void TendDrift(Valve& valve);
  void ReportFull(Valve& valve, std::size_t channel,
                  const FollowedDrift& drift);
  void TendSilent(TimePoint now);
  void GiveUpRecovery();
  void TakeCensus();
  void PublishLast();
  void TakeCheckpoint();

  PipelineOptions options_;
  DecisionSink& decisions_;
  LiveSink* live_;
  std::shared_ptr<const ModelResolver> resolver_;
  MonitorContext context_;
  Counters& counters_;
  ThrottledLog& log_;
  Journal journal_;
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<ShadowBank> shadow_;
  std::unique_ptr<LookWorker> looks_;  // Null: no second looks.
  EnginePlans plans_;

  std::vector<std::unique_ptr<Valve>> valves_;  // In the order of first sight.
  std::unordered_map<std::string, Valve*, Hash, std::equal_to<>> by_id_;
  // Known valves that have no place yet; strangers leave that many free.
  std::unordered_set<std::string, Hash, std::equal_to<>> reserved_;
  std::vector<Valve*> idle_;  // Silent strangers, as of the last Tend().
  std::vector<FollowedDrift> drift_;         // Of the valve that is tended.
  std::unordered_set<std::size_t> refused_;  // Hashes of ids.
  std::unordered_map<std::string, OpenEpisode> recovered_;
  std::unordered_map<std::string, Accumulator> accumulators_;
  std::optional<TimePoint> recovery_deadline_;  // While there is something to.

  bool started_{false};
  Pulse pulse_;
  std::uint64_t offered_{0};
  TimePoint last_tended_;
  TimePoint last_checkpoint_;

  mutable std::mutex mutex_;  // Guards what follows.
  std::shared_ptr<const ModelResolver> next_resolver_;
  std::vector<std::string> names_;
  ValveCensus census_;
};

}  // namespace fdi::monitor
