#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "base/mutex.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/journal.h"
#include "monitor/names/audit_worker.h"
#include "monitor/names/look_worker.h"
#include "monitor/sinks.h"
#include "monitor/throttled_log.h"
#include "monitor/valve_monitor.h"

namespace fdi::monitor {

/// Settings of Pipeline.
struct PipelineOptions {
  int max_valves{2000};
  /// An unknown valve, one without a model set assigned by id and without an
  /// episode left by the last session, may be evicted in favour of another
  /// valve after this silence, or at once after its publisher ended the stream;
  /// in favour of nobody, stale_timeout_s after that end.
  std::chrono::milliseconds place_timeout{60'000};
  std::string valve_glob{"*"};
  TraceOptions trace;
  double stale_timeout_s{3600.0};  ///< Ends an episode.
  /// An episode left open by the last session is closed if its valve stays
  /// silent for this long after the start.
  std::chrono::milliseconds recovery_window{60'000};
  std::chrono::milliseconds checkpoint_period{60'000};
  JournalOptions journal;
  bool second_look{true};       ///< By simulation, for model sets with physics.
  bool loop_audit{true};        ///< For valves without a model set.
  bool audit_all_loops{false};  ///< And for those with one.
  /// Tells which episodes are alarms; null: all.
  std::shared_ptr<const AlarmGate> alarms{};
  /// Gives episodes their severity; without bands all are medium.
  std::shared_ptr<const SeverityCatalogue> severities{
      std::make_shared<const SeverityCatalogue>()};
};

/// Counts and logs what becomes of second looks; for LookWorker.
LookReport LookReportOf(const MonitorContext& context);

/// Receivers of the results; all outlive the pipeline.
struct PipelineSinks {
  DecisionSink& decisions;
  EventSink& events;
  HistorySink& history;
};

/// The current state of the valves.
struct ValveCensus {
  std::uint64_t valves{0};
  std::uint64_t unassigned{0};
  std::uint64_t stale{0};
  std::uint64_t ended{0};
  std::uint64_t open_episodes{0};
  std::uint64_t trace_bytes{0};
  /// Valves with a ValveMonitor::unjudged_since_ns(),
  std::uint64_t unjudged{0};
  std::string unjudged_valve;   ///< the one of them for longest,
  std::int64_t unjudged_ns{0};  ///< since then,
  std::string unjudged_reason;  ///< and why: "UNCOVERED cv".
  std::uint64_t contested{0};   ///< ValveMonitor::Contested();
  std::string contested_valve;  ///< one of them.
};

/// From samples to decisions, events and records. The thread that takes samples
/// from the bus, the diagnosis thread, also diagnoses them: its backlog stays
/// at the subscriber, which then stops receiving, so nothing is dropped and no
/// thread is needed to move samples.
///
///     diagnosis thread: OnSample() -> engine -> decision vectors
///                                    |-> Journal: history thread, publisher
///                                    |-> ValveListener, one after the other
///                                    \-> LookWorker, AuditWorker, which
///                                        answer later
///
/// Built idle; Start() starts the threads of these parts. All calls come from
/// the diagnosis thread, Start() and Stop() while it does not run, except where
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

  /// Adds a listener, which is called after those added before it. Before
  /// Start(); it outlives the pipeline.
  void Attach(ValveListener& listener) { listeners_.push_back(&listener); }
  /// The same, of a listener that nobody else uses.
  void Attach(std::unique_ptr<ValveListener> listener);

  /// @param open episodes that the last session left open.
  /// @param accumulators of the valves, from the last checkpoint.
  void Start(const std::vector<OpenEpisode>& open,
             std::vector<Accumulator> accumulators = {});

  /// Reports that `event`, of an earlier session, was published. Before
  /// Start().
  void MarkPublished(const FaultEvent& event) { journal_.MarkPublished(event); }

  /// Processes a received sample. @param writer its DDS writer.
  void OnSample(std::string_view valve_id, const Sample& sample,
                std::uint64_t writer,
                TimePoint received = std::chrono::steady_clock::now());
  /// The writer ended the stream of the valve.
  void OnStreamEnded(std::string_view valve_id, std::uint64_t writer);

  /// Periodic work: silent valves, checkpoints, new subscribers, changed
  /// assignments. Call about ten times a second, even under load. @param now
  /// all samples received earlier have been offered.
  void Poll(TimePoint now = std::chrono::steady_clock::now());
  /// Records a gap. Thread safe.
  void ReportGap(DataGap gap) { journal_.OnGap(std::move(gap)); }
  /// Sends the decision vectors that the sink has buffered, as Poll() does.
  void FlushDecisions();

  /// Has all valves use `resolver` from the next Poll() on: the change falls
  /// between two samples, of which none is lost or diagnosed twice. Thread
  /// safe.
  void Reassign(std::shared_ptr<const ModelResolver> resolver);

  /// Stores and publishes what is queued, then ends the threads; does nothing
  /// if they were not started. Episodes stay open for the next session to
  /// continue.
  /// @throws what a thread ended with.
  void Stop();

  /// The functions below are thread safe.

  /// A thread ended with an exception, which Stop() throws.
  bool failed() const {
    return journal_.failed() || (looks_ && looks_->failed()) ||
           (audits_ && audits_->failed());
  }
  ValveCensus census() const;                    ///< As of the last Poll().
  std::vector<std::string> valve_names() const;  ///< All valves seen.
  bool history_degraded() const { return journal_.degraded(); }
  Journal::Backlog journal_backlog() const { return journal_.backlog(); }
  /// Diagnosis and history.
  std::vector<Heartbeat::Member> threads() const {
    return {{"diagnosis", &pulse_}, {"history", &journal_.pulse()}};
  }

 private:
  struct Valve {
    ValveMonitor monitor;
    bool known;             // Never evicted.
    SignalMask missing{0};  // In an accepted sample; logged when it changes.
    SignalMask held{0};     // Logged when there are more.
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
  bool FreeSlot(bool for_known);
  void Evict(Valve& valve);
  bool IsEvictable(const Valve& valve) const;
  Valve& AddValve(std::string_view valve_id);
  bool Resolve(const std::string& valve_id, std::optional<EngineParts>& parts);
  void Count(Valve& valve, const Sample& sample, const ValveOutcome& outcome);
  void Publish(const Valve& valve, const ValveOutcome& outcome);
  void Recover(const std::vector<OpenEpisode>& episodes);
  void AdoptNextResolver();
  void CheckSilentValves(TimePoint now);
  void ForgetEnded(TimePoint now, std::chrono::milliseconds age);
  void ExpireRecovery();
  void UpdateCensus(TimePoint now);
  void PublishLast();
  void TakeCheckpoint(bool urgent);
  template <typename Call>
  void Tell(Call call);

  PipelineOptions options_;
  DecisionSink& decisions_;
  std::shared_ptr<const ModelResolver> resolver_;
  MonitorContext context_;
  Counters& counters_;
  ThrottledLog& log_;
  Journal journal_;
  std::unique_ptr<LookWorker> looks_;    // Null: no second looks.
  std::unique_ptr<AuditWorker> audits_;  // Null: no audits.
  std::vector<ValveListener*> listeners_;
  std::vector<std::unique_ptr<ValveListener>> owned_;  // Part of listeners_.
  EnginePlans plans_;

  std::vector<std::unique_ptr<Valve>> valves_;  // In order of first samples.
  std::unordered_map<std::string, Valve*, Hash, std::equal_to<>> by_id_;
  // Known valves without a slot yet; unknown ones leave that many slots free.
  std::unordered_set<std::string, Hash, std::equal_to<>> reserved_;
  std::vector<Valve*> idle_;  // Silent unknown valves, as of the last Poll().
  std::unordered_set<std::size_t> refused_;  // Hashes of ids.
  // The known episodes of valves without a slot.
  std::unordered_map<std::string, EpisodeTracker> recovered_;
  std::unordered_map<std::string, Accumulator> accumulators_;
  std::optional<TimePoint> recovery_deadline_;  // Empty: none is left.

  bool started_{false};
  Pulse pulse_;
  std::uint64_t offered_{0};
  TimePoint last_poll_;
  TimePoint last_checkpoint_;

  mutable Mutex mutex_;
  std::shared_ptr<const ModelResolver> next_resolver_ GUARDED_BY(mutex_);
  std::vector<std::string> names_ GUARDED_BY(mutex_);
  ValveCensus census_ GUARDED_BY(mutex_);
};

}  // namespace fdi::monitor
