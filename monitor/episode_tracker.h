#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "diagnosis/decision/alarm_budget.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/fault_event.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "monitor/trace.h"

namespace fdi::monitor {

/// The budget of alarms as it is now; it is made anew as hours come. Thread
/// safe.
class AlarmGate {
 public:
  void Set(std::shared_ptr<const AlarmBudget> budget) {
    const MutexLock lock(mutex_);
    budget_ = std::move(budget);
  }
  /// Null: every episode is an alarm.
  std::shared_ptr<const AlarmBudget> Get() const {
    const MutexLock lock(mutex_);
    return budget_;
  }

 private:
  mutable Mutex mutex_;
  std::shared_ptr<const AlarmBudget> budget_ GUARDED_BY(mutex_);
};

/// Settings of the evidence kept beside an episode, in the time of samples.
struct TraceOptions {
  double before_s{1800.0};           ///< Kept before a detection.
  std::size_t before_points{1800};   ///< At most; bounds the memory of a valve.
  double after_isolation_s{600.0};   ///< Kept on after the first isolation.
  double after_detection_s{3600.0};  ///< And if it is never isolated.
  int points_per_write{10};          ///< Written as it goes.
};

/// Where a tracker's results go.
class EpisodeOutlet {
 public:
  virtual ~EpisodeOutlet() = default;
  virtual void OnEvent(FaultEvent event) = 0;
  virtual void OnEvidence(EpisodeTrace trace) = 0;
  virtual void OnLook(EpisodeLook look) = 0;
  virtual void OnStrength(StrengthPoint point) = 0;
  virtual void OnGap(DataGap gap) = 0;
  /// The valve was judged, and is normal.
  virtual void OnNormal(const std::string& valve_id, std::int64_t stamp_ns) = 0;
  /// The valve has sent nothing since then, so that nothing confirms its open
  /// episode; nothing: it sends again.
  virtual void OnSilence(const std::string& valve_id,
                         std::optional<std::int64_t> since_ns) = 0;
  /// An episode of an earlier session goes on.
  virtual void OnResumed(const OpenEpisode& episode, std::int64_t stamp_ns) = 0;
};

/// Turns what the engine of one valve says into the episodes of that valve:
/// ids, events, evidence, gaps.
///
/// An episode that an earlier session left open is resumed, under its old id,
/// if the same source goes on and is detected abnormal again within the first
/// minute (or twice the settling time, if that is longer); else it is closed
/// with `unknown`. What it is called, EpisodeName says.
class EpisodeTracker {
 public:
  /// @param gate tells which of its episodes are alarms; null: all.
  EpisodeTracker(std::string valve_id, const TraceOptions& options,
                 std::shared_ptr<const AlarmGate> gate = nullptr);

  /// An earlier session left `episode` open. Before the first Step().
  void Recover(const OpenEpisode& episode) { recovered_ = episode; }

  /// The next sample and its verdict by `models`: the gap before it, and
  /// whether recovering() may still go on.
  void Advance(const Sample& sample, const Verdict& verdict,
               const ModelSet& models, EpisodeOutlet& outlet);

  /// The same sample, and the verdict with the name that counts.
  void Step(const Sample& sample, const Verdict& verdict,
            const std::shared_ptr<const ModelSet>& models,
            EpisodeOutlet& outlet);

  /// Weighs the open episode by `verdict`, which is of its own models: a notice
  /// that is rare by now is told as an alarm. Step() does it, too.
  void Reweigh(const Verdict& verdict, EpisodeOutlet& outlet);

  /// Instants of before the first Step(), oldest first, for the evidence alone.
  void Remember(const std::vector<Sample>& samples, const ModelSet& models);

  /// What a second look made of the open episode, but for its id.
  void Take(std::optional<EpisodeLook> look, EpisodeOutlet& outlet);

  /// How strong its faults were, but for its id.
  void Take(const std::vector<StrengthPoint>& points, EpisodeOutlet& outlet);

  /// The engine was made to end its episode. @param models it ran with.
  void End(const Transition& closed,
           const std::shared_ptr<const ModelSet>& models,
           EpisodeOutlet& outlet);

  /// The samples stay away: closes what was to be resumed, with `unknown`.
  /// @param now_ns UTC, the end of the gap if none came at all.
  void ExpireRecovery(std::int64_t now_ns, EpisodeOutlet& outlet);

  /// Closes what was to be resumed.
  void AbandonRecovery(EndReason reason, EpisodeOutlet& outlet);

  /// Hands over evidence that is not written yet; for an orderly stop.
  void Flush(EpisodeOutlet& outlet);

  /// The episode that is to be resumed; null: none is.
  const OpenEpisode* recovering() const {
    return recovered_ ? &*recovered_ : nullptr;
  }
  /// The episode that a detection at `sample`, the next one, with these models
  /// resumes; null: it begins a new one.
  const OpenEpisode* Resumable(const Sample& sample,
                               const ModelSet& models) const;
  std::size_t trace_bytes() const { return trace_.bytes(); }
  /// An episode is open that is within the budget of alarms.
  bool notice() const { return open_ && open_->notice; }
  /// The instants are evidence of an open episode.
  bool tracing() const { return open_ && open_->tracing; }

 private:
  struct Open {
    std::uint64_t episode_id{0};
    std::uint64_t source_id{0};
    std::shared_ptr<const ModelSet> models;
    std::int64_t detection_stamp_ns{0};  // As recorded.
    std::int64_t trace_until_ns{0};
    bool tracing{true};
    FaultSet faults{0};  // Its name.
    std::vector<FaultCandidate> candidates;
    double first_share{0.0};  // At its detection.
    double share{0.0};        // The largest so far.
    int lasted{0};            // Whole hours.
    std::optional<double> return_hours;
    bool notice{true};  // Until it is weighed, which is at once.
    Transition last{};  // The last one that was told.
  };

  void RecordGap(const Sample& sample, const Verdict& verdict,
                 const ModelSet& models, EpisodeOutlet& outlet);
  void TryRecovery(const Sample& sample, const ModelSet& models,
                   EpisodeOutlet& outlet);
  std::optional<EndReason> Expires(const Sample& sample,
                                   const ModelSet& models) const;
  bool Resumes(std::uint64_t source_id, const ModelSet& models) const;
  void CloseRecovered(EndReason reason, std::int64_t stamp_ns,
                      EpisodeOutlet& outlet);
  FaultEvent EndOf(const OpenEpisode& episode, EndReason reason,
                   std::int64_t stamp_ns) const;
  void Take(const Transition& transition, const Verdict& verdict,
            const std::shared_ptr<const ModelSet>& models,
            EpisodeOutlet& outlet);
  // @returns whether it resumes an episode.
  bool Begin(const Transition& transition, const Verdict& verdict,
             const std::shared_ptr<const ModelSet>& models,
             EpisodeOutlet& outlet);
  void Weigh(const Verdict& verdict);
  void FollowUnknown(const Verdict& verdict, const ModelSet& models);
  void Emit(Transition transition,
            const std::shared_ptr<const ModelSet>& models,
            EpisodeOutlet& outlet);
  void WriteTrace(bool complete, EpisodeOutlet& outlet);

  std::string valve_id_;
  TraceOptions options_;
  std::shared_ptr<const AlarmGate> gate_;
  Trace trace_;
  std::optional<Open> open_;
  std::optional<OpenEpisode> recovered_;  // Left by an earlier session.
  bool seen_{false};
  bool rejected_since_{false};
  std::int64_t first_stamp_ns_{0};
  std::int64_t accepted_stamp_ns_{0};  // 0: none of this source yet
  std::uint64_t source_id_{0};
  std::uint64_t seq_{0};
  std::uint64_t model_hash_{0};  // Of the valve, whatever its episode is of.
  std::uint32_t epoch_{0};
  bool replaces_alarm_{false};  // The observers' next episode, of the audit's.
};

}  // namespace fdi::monitor
