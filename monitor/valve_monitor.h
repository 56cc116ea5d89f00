#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/decision/decision.h"
#include "diagnosis/observers/intake.h"
#include "monitor/checkpoint.h"
#include "monitor/episode_tracker.h"
#include "monitor/names/loop_judge.h"
#include "monitor/names/pending_looks.h"
#include "monitor/sinks.h"

namespace fdi::monitor {

/// One valve of the plant: the decision on it, its episodes, its clock.
/// A valve without a model set is judged by the audit of its loop (LoopJudge),
/// with the set of AuditModels(); until it is, its quality is UNASSIGNED.
/// Of a valve with one the audit tells, if it is to (AuditWorker), while the
/// engine finds nothing: its verdicts are those of the engine, its episodes
/// those of either.
///
/// One thread at a time.
class ValveMonitor {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  /// @param parts of the model set; nothing: none is assigned.
  /// @param looks performs second looks if the model set has physics, and
  ///   outlives this; null: none.
  /// @param severities by which episodes get their priority.
  /// @param audits of the loop; outlives this; null: none.
  /// @param gate tells which episodes are alarms; null: all.
  ValveMonitor(const std::string& id, const std::optional<EngineParts>& parts,
               const TraceOptions& options, LookWorker* looks = nullptr,
               std::shared_ptr<const SeverityCatalogue> severities =
                   std::make_shared<const SeverityCatalogue>(),
               AuditWorker* audits = nullptr,
               std::shared_ptr<const AlarmGate> gate = nullptr);

  /// Call before the first Step().
  void Recover(const OpenEpisode& episode);
  /// The same. @param tracker knows earlier episodes of the valve.
  void Recover(EpisodeTracker tracker);

  /// The accumulators from the last checkpoint of an earlier session; used if
  /// the first sample comes from the same source. Before the first Step().
  void Resume(Accumulator accumulator) { saved_ = std::move(accumulator); }

  /// See ModelResolver::IsolationHeld().
  void HoldIsolation(bool hold);

  /// Adds the time since the last call and, unless the valve is silent, the
  /// accumulators.
  void TakeCheckpoint(Checkpoint& checkpoint);

  /// Rate limit. A sample that restarts the engine (a gap, another source or
  /// another epoch) costs many times as much as others and adds rows to the
  /// history. So 200 of them in a row are accepted, then five a second plus one
  /// for every two other samples. @returns false if `sample` is to be rejected.
  bool WithinRateLimit(const Sample& sample, TimePoint received);

  /// @param writer its DDS writer; see EndStream().
  ValveOutcome Step(const Sample& sample, std::uint64_t writer,
                    TimePoint received, EpisodeOutlet& outlet);

  /// The writer ended the stream. Ignored if another writer has taken over.
  /// @returns whether the stream ended.
  bool EndStream(std::uint64_t writer, EpisodeOutlet& outlet);

  /// Switches to another model set, or none, from the next sample on. @returns
  /// whether it differs from the current one.
  bool Adopt(const std::optional<EngineParts>& parts, EpisodeOutlet& outlet);

  /// Labels the valve STALE if it was silent for three periods: nothing
  /// confirms its open episode then.
  /// @returns whether it became so by this call.
  bool CheckStale(TimePoint now, EpisodeOutlet& outlet);

  /// Periods of silence of a STALE valve since the last call; they count as
  /// time.
  std::uint64_t CountStale(TimePoint now);

  /// Closes an open episode after a long silence.
  void CheckTimeout(TimePoint now, std::chrono::milliseconds timeout,
                    EpisodeOutlet& outlet);

  /// Closes an episode that was to be resumed if the valve is silent.
  void ExpireRecovery(std::int64_t now_ns, EpisodeOutlet& outlet);

  /// The last call: stores what is left, and that nothing confirms an open
  /// episode any more.
  void Flush(EpisodeOutlet& outlet);

  /// Rows of time since the last TakeCheckpoint().
  std::size_t book_rows() const { return coverage_.rows(); }
  /// Time since the last sample; infinite once the stream has ended.
  TimePoint::duration Silence(TimePoint now) const {
    return ended_ ? TimePoint::duration::max() : now - received_;
  }
  /// Time since the last sample of a stream that has ended; 0: it has not.
  TimePoint::duration EndedSince(TimePoint now) const {
    return ended_ ? now - received_ : TimePoint::duration::zero();
  }

  const std::string& id() const { return id_; }
  /// Also that of the audit; null: nothing judges the valve.
  const ModelSet* models() const { return models_.get(); }
  /// A sample has been received.
  bool seen() const { return seen_; }
  /// The verdict on the last sample.
  const Verdict& verdict() const {
    return decision_ ? decision_->verdict() : judge_.watch().verdict();
  }
  /// Stamp of the last sample that was judged, or of the first one, of a valve
  /// that sends, in AUTO, and is not judged for longer than its models need to
  /// settle. Nothing: it is judged, or falls silent, or nothing judges it.
  std::optional<std::int64_t> unjudged_since_ns() const;
  bool stale() const { return stale_; }
  bool ended() const { return ended_; }
  /// Its episode, if it had one, was closed for want of samples, and no sample
  /// has come since: verdict() is that of no sample.
  bool closed() const { return closed_; }
  /// Two publishers share the id: of the one that the newest source superseded
  /// samples still come. Only those of the newest are judged.
  bool Contested(TimePoint now) const;
  bool episode_open() const {
    return (decision_ && decision_->episode_open()) ||
           judge_.watch().episode_open();
  }
  /// An episode of an earlier session may go on here.
  bool recovering() const { return tracker_.recovering() != nullptr; }
  std::size_t trace_bytes() const { return tracker_.trace_bytes(); }

 private:
  static constexpr double kMaxRestartTokens = 200.0;

  ValveOutcome StepLoop(const Sample& sample, bool superseded, bool swapped,
                        EpisodeOutlet& outlet);
  void StepAudit(const Sample& sample, const Verdict& verdict,
                 EpisodeOutlet& outlet);
  void TellOfLoop(const Sample& sample, EpisodeOutlet& outlet);
  void Hear(Intake intake, std::uint64_t writer, TimePoint received,
            EpisodeOutlet& outlet);
  TimePoint::duration SourcePatience() const;
  bool RestartsEngine(const Sample& sample) const;
  void RecordPosition(const Sample& sample);
  void RecordJudged(const Verdict& verdict);
  std::int64_t UnjudgedPatienceNs() const;
  void MeasurePeriod(std::int64_t stamp_ns);
  void Close(EndReason reason, EpisodeOutlet& outlet);
  void CloseAudit(EndReason reason, EpisodeOutlet& outlet);
  LookWorker::Physics Physics() const;
  void ConfirmNormal(const Verdict& verdict, EpisodeOutlet& outlet);
  void RestoreOnce(std::uint64_t source_id);
  double period_s() const;

  std::string id_;
  std::shared_ptr<const ModelSet> models_;
  SignalMask required_{0};            // By models_.
  std::optional<Decision> decision_;  // Nothing: no model set.
  LookWorker* looks_;
  PendingLooks pending_;
  std::shared_ptr<const SeverityCatalogue> severities_;
  EpisodeTracker tracker_;
  LoopJudge judge_;
  CoverageBook coverage_;
  std::optional<Accumulator> saved_;
  SourceOrder order_{1.0};  // Without a model set; an engine has its own.
  int rival_samples_{0};    // Of superseded sources, so many,
  TimePoint rival_at_;      // the last one then.
  std::uint64_t source_id_{0};
  std::int64_t stamp_ns_{0};   // Of the last sample in order.
  std::int64_t judged_ns_{0};  // Of the last one that was judged; 0: none yet.
  bool isolation_held_{false};
  // Normal samples since nothing was open here, up to what a valve needs to be
  // normal again.
  int normal_samples_{0};
  bool found_normal_{false};     // By the sample at hand.
  bool normal_by_audit_{false};  // Its last episode is not confirmed yet.
  // Without a model set: the period of the samples, and the last interval.
  std::int64_t unassigned_period_ns_{1'000'000'000};
  std::optional<std::int64_t> unassigned_interval_ns_;
  double restart_tokens_{kMaxRestartTokens};  // Restarts left
  TimePoint tokens_at_;                       // as of this time.
  std::uint32_t epoch_{0};                    // Of the last sample in order.
  bool swapped_{false};
  bool seen_{false};
  bool stale_{false};
  bool ended_{false};
  bool closed_{false};
  std::uint64_t writer_{0};
  TimePoint received_;
  TimePoint stale_counted_;  // Silence is counted up to here.
};

}  // namespace fdi::monitor
