#include "monitor/episode_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/time_units.h"
#include "diagnosis/model/model_set.h"

namespace fdi::monitor {
namespace {

constexpr double kResumeWindowS = 60.0;

std::int64_t Ns(double seconds) {
  return std::llround(seconds * 1e9);
}

// For so long after its first sample a valve may resume an episode.
std::int64_t ResumeWindowNs(const ModelSet& models) {
  return Ns(std::max(kResumeWindowS, 2.0 * models.decision.settling_samples *
                                         models.sample_period_s));
}

bool EndsEpisode(const Transition& transition) {
  return transition.kind == TransitionKind::kCleared ||
         transition.kind == TransitionKind::kClosed;
}

}  // namespace

EpisodeTracker::EpisodeTracker(std::string valve_id,
                               const TraceOptions& options,
                               std::shared_ptr<const AlarmGate> gate)
    : valve_id_(std::move(valve_id)),
      options_(options),
      gate_(std::move(gate)),
      trace_(options.before_points, Ns(options.before_s)) {}

bool EpisodeTracker::Resumes(std::uint64_t source_id,
                             const ModelSet& models) const {
  return recovered_ && recovered_->source_id == source_id &&
         recovered_->model_hash == models.content_hash;
}

const OpenEpisode* EpisodeTracker::Resumable(const Sample& sample,
                                             const ModelSet& models) const {
  return Resumes(sample.source_id, models) && !Expires(sample, models)
             ? &*recovered_
             : nullptr;
}

// TryRecovery() follows RecordGap(), which needs to know whether any sample
// came before.
void EpisodeTracker::Advance(const Sample& sample, const Verdict& verdict,
                             const ModelSet& models, EpisodeOutlet& outlet) {
  if (!OutOfOrder(verdict.intake)) {
    RecordGap(sample, verdict, models, outlet);
    TryRecovery(sample, models, outlet);
    source_id_ = sample.source_id;
    seq_ = sample.seq;
    model_hash_ = models.content_hash;
    epoch_ = sample.epoch;
  }
}

// The trace takes the sample before the transitions, so that what they write
// includes it.
void EpisodeTracker::Step(const Sample& sample, const Verdict& verdict,
                          const std::shared_ptr<const ModelSet>& models,
                          EpisodeOutlet& outlet) {
  if (OutOfOrder(verdict.intake)) {
    return;
  }
  const int channels = static_cast<int>(models->channels.size());
  const int faults = static_cast<int>(models->faults.size());
  // Push() would restart the trace and lose what is not written yet.
  if (tracing() && !trace_.Continues(sample, verdict, channels, faults)) {
    WriteTrace(false, outlet);
  }
  // before_s bounds what precedes a detection. Of an open episode nothing may
  // be dropped before it is written, which takes points_per_write samples.
  // What an audit rests on is longer, and given to Remember() when it counts.
  trace_.set_span_ns(tracing() || models->channels.empty()
                         ? std::numeric_limits<std::int64_t>::max()
                         : Ns(options_.before_s));
  trace_.Push(sample, verdict, channels, faults);
  for (const Transition& transition : verdict.Transitions()) {
    Take(transition, verdict, models, outlet);
  }
  // The observers go on beside an episode of the audit.
  if (open_ && open_->models->content_hash == models->content_hash) {
    Reweigh(verdict, outlet);
  }
  FollowUnknown(verdict, *models);
  if (tracing()) {
    const bool complete = sample.stamp_ns > open_->trace_until_ns;
    if (complete || verdict.transition_count > 0 ||
        trace_.size() >= static_cast<std::size_t>(options_.points_per_write)) {
      WriteTrace(complete, outlet);
    }
  }
}

void EpisodeTracker::Reweigh(const Verdict& verdict, EpisodeOutlet& outlet) {
  if (!open_ || EndsEpisode(open_->last)) {
    return;
  }
  const bool was_notice = open_->notice;
  Weigh(verdict);
  if (was_notice && !open_->notice) {
    Transition raised = open_->last;
    raised.kind = TransitionKind::kRaised;
    raised.stamp_ns = verdict.stamp_ns;
    Emit(raised, open_->models, outlet);
  }
}

void EpisodeTracker::Remember(const std::vector<Sample>& samples,
                              const ModelSet& models) {
  trace_.set_span_ns(std::numeric_limits<std::int64_t>::max());
  Verdict normal;
  normal.quality = Quality::kLive;
  normal.normal_factor = 1.0;
  for (const Sample& sample : samples) {
    trace_.Push(sample, normal, static_cast<int>(models.channels.size()),
                static_cast<int>(models.faults.size()));
  }
}

void EpisodeTracker::Take(std::optional<EpisodeLook> look,
                          EpisodeOutlet& outlet) {
  if (look && open_) {
    look->episode_id = open_->episode_id;
    outlet.OnLook(std::move(*look));
  }
}

void EpisodeTracker::Take(const std::vector<StrengthPoint>& points,
                          EpisodeOutlet& outlet) {
  for (StrengthPoint point : points) {
    if (open_) {
      point.episode_id = open_->episode_id;
      outlet.OnStrength(point);
    }
  }
}

// A stretch without accepted samples is a gap.
void EpisodeTracker::RecordGap(const Sample& sample, const Verdict& verdict,
                               const ModelSet& models, EpisodeOutlet& outlet) {
  // The stamps of two sources are not compared.
  if (seen_ && sample.source_id != source_id_) {
    accepted_stamp_ns_ = 0;
  }
  if (verdict.intake != Intake::kAccepted) {
    rejected_since_ = true;
    return;
  }
  const std::int64_t since = accepted_stamp_ns_;
  if (since != 0 &&
      sample.stamp_ns - since > Ns(kGapPeriods * models.sample_period_s)) {
    outlet.OnGap({valve_id_, since, sample.stamp_ns,
                  rejected_since_ ? "bad_input" : "stream"});
  }
  accepted_stamp_ns_ = sample.stamp_ns;
  rejected_since_ = false;
}

void EpisodeTracker::TryRecovery(const Sample& sample, const ModelSet& models,
                                 EpisodeOutlet& outlet) {
  if (!std::exchange(seen_, true)) {
    first_stamp_ns_ = sample.stamp_ns;
    if (recovered_ && sample.stamp_ns > recovered_->last_stamp_ns) {
      outlet.OnGap({valve_id_, recovered_->last_stamp_ns, sample.stamp_ns,
                    "monitor_down"});
    }
  }
  if (const std::optional<EndReason> reason = Expires(sample, models)) {
    CloseRecovered(*reason, sample.stamp_ns, outlet);
  }
}

// Why the next sample ends what was to be resumed, if it does.
std::optional<EndReason> EpisodeTracker::Expires(const Sample& sample,
                                                 const ModelSet& models) const {
  if (!recovered_) {
    return std::nullopt;
  }
  // The bits of its faults mean nothing in another model set. What the audit
  // found, it does not find again within that time.
  if (recovered_->model_hash != models.content_hash &&
      recovered_->layer != Layer::kAudit) {
    return EndReason::kModelChanged;
  }
  const std::int64_t first_ns = seen_ ? first_stamp_ns_ : sample.stamp_ns;
  return !Resumes(sample.source_id, models) ||
                 sample.stamp_ns - first_ns > ResumeWindowNs(models)
             ? std::optional(EndReason::kUnknown)
             : std::nullopt;
}

void EpisodeTracker::CloseRecovered(EndReason reason, std::int64_t stamp_ns,
                                    EpisodeOutlet& outlet) {
  const OpenEpisode episode = *std::exchange(recovered_, std::nullopt);
  // stamp_ns is 0 if this session saw no sample.
  outlet.OnEvent(
      EndOf(episode, reason, std::max(stamp_ns, episode.last_stamp_ns)));
}

FaultEvent EpisodeTracker::EndOf(const OpenEpisode& episode, EndReason reason,
                                 std::int64_t stamp_ns) const {
  FaultEvent event;
  event.valve_id = valve_id_;
  event.source_id = episode.source_id;
  event.episode_id = episode.episode_id;
  event.transition.kind = TransitionKind::kClosed;
  event.transition.stamp_ns = stamp_ns;
  event.transition.detection_stamp_ns = episode.detection_stamp_ns;
  event.transition.faults = episode.faults;
  event.transition.reason = reason;
  event.transition.layer = episode.layer;
  event.transition.severity = episode.severity;
  event.transition.share = episode.share;
  event.transition.notice = episode.notice;
  if (!episode.candidates.empty()) {
    event.transition.factor = episode.candidates.front().factor;
    event.transition.strength = episode.candidates.front().strength;
  }
  event.candidates = episode.candidates;
  event.model_set = episode.model_set;
  event.model_version = episode.model_version;
  event.model_hash = episode.model_hash;
  return event;
}

bool EpisodeTracker::Begin(const Transition& transition, const Verdict& verdict,
                           const std::shared_ptr<const ModelSet>& models,
                           EpisodeOutlet& outlet) {
  open_ = Open{};
  open_->models = models;
  open_->trace_until_ns = transition.stamp_ns + Ns(options_.after_detection_s);
  if (Resumes(verdict.source_id, *models)) {
    const OpenEpisode episode = *std::exchange(recovered_, std::nullopt);
    open_->episode_id = episode.episode_id;
    open_->source_id = episode.source_id;
    open_->detection_stamp_ns = episode.detection_stamp_ns;
    open_->faults = episode.faults;
    open_->candidates = episode.candidates;
    open_->first_share = open_->share = episode.share;
    open_->notice = episode.notice;
    open_->last = transition;
    open_->last.faults = episode.faults;
    open_->last.layer = episode.layer;
    open_->last.severity = episode.severity;
    outlet.OnResumed(episode, verdict.stamp_ns);
    return true;
  }
  open_->source_id = verdict.source_id;
  open_->first_share = verdict.share;
  // An alarm that it takes the place of goes on in it.
  open_->notice = !std::exchange(replaces_alarm_, false);
  open_->detection_stamp_ns = transition.detection_stamp_ns;
  open_->episode_id =
      EpisodeId(valve_id_, verdict.source_id, transition.detection_stamp_ns);
  return false;
}

void EpisodeTracker::Take(const Transition& transition, const Verdict& verdict,
                          const std::shared_ptr<const ModelSet>& models,
                          EpisodeOutlet& outlet) {
  // The earlier session has reported the detection of what goes on.
  if (transition.kind == TransitionKind::kDetected &&
      Begin(transition, verdict, models, outlet)) {
    return;
  }
  if (!open_) {
    return;
  }
  if (transition.kind == TransitionKind::kDetected) {
    Weigh(verdict);
  }
  if (transition.kind == TransitionKind::kIsolated) {
    open_->trace_until_ns =
        transition.stamp_ns + Ns(options_.after_isolation_s);
  }
  // At its end the factors do not concern this episode any more: they are those
  // of a normal valve, or of the next source.
  if (!EndsEpisode(transition)) {
    open_->faults = transition.faults;
    open_->candidates = CandidatesOf(*models, verdict, transition.faults);
    // What the observers hold likely beside is refuted by the simulation.
    if (transition.layer == Layer::kPhysics) {
      std::erase_if(open_->candidates,
                    [](const FaultCandidate& each) { return !each.isolated; });
    }
  }
  Emit(transition, models, outlet);
}

// An alarm stays one: its evidence does not go away by what follows. An episode
// that reached a limit lasts while it is beyond one, another while it is open.
void EpisodeTracker::Weigh(const Verdict& verdict) {
  open_->share = std::max(open_->share, verdict.share);
  if (verdict.share > 1.0 || open_->share <= 1.0) {
    const std::int64_t open_ns = verdict.stamp_ns - open_->detection_stamp_ns;
    open_->lasted =
        std::max(open_->lasted, static_cast<int>(open_ns / kNsPerHour));
  }
  const auto budget = gate_ ? gate_->Get() : nullptr;
  if (!budget || !budget->Covers(valve_id_, model_hash_, epoch_)) {
    open_->notice = false;
    return;
  }
  const AlarmBudget::Weight weight =
      budget->Weigh(valve_id_, open_->share, open_->lasted);
  open_->return_hours = weight.return_hours;
  open_->notice = open_->notice && weight.notice;
}

// An episode without a name keeps the faults that could explain it last; none
// once none of the known ones does. Normal samples say nothing of that.
void EpisodeTracker::FollowUnknown(const Verdict& verdict,
                                   const ModelSet& models) {
  if (!open_ || open_->faults != 0 || verdict.state != State::kDetected ||
      verdict.normal_factor >= models.decision.isolation_threshold) {
    return;
  }
  if (verdict.unknown == Unknown::kOutsideKnown) {
    open_->candidates.clear();
    return;
  }
  std::vector<FaultCandidate> candidates = CandidatesOf(models, verdict, 0);
  if (!candidates.empty()) {
    open_->candidates = std::move(candidates);
  }
}

void EpisodeTracker::Emit(Transition transition,
                          const std::shared_ptr<const ModelSet>& models,
                          EpisodeOutlet& outlet) {
  const bool closed = transition.kind == TransitionKind::kClosed;
  const bool superseded = transition.reason == EndReason::kSuperseded;
  transition.detection_stamp_ns = open_->detection_stamp_ns;
  // An episode that began beyond no limit counts as such, whatever comes.
  transition.share =
      open_->first_share > 1.0 ? open_->share : open_->first_share;
  transition.return_hours = open_->return_hours;
  transition.notice = open_->notice;
  open_->last = transition;
  FaultEvent event;
  event.valve_id = valve_id_;
  event.source_id = open_->source_id;
  event.seq = seq_;
  event.episode_id = open_->episode_id;
  event.transition = transition;
  event.candidates = open_->candidates;
  event.models = models;
  event.model_set = models->name;
  event.model_version = models->version;
  event.model_hash = models->content_hash;
  outlet.OnEvent(std::move(event));
  if (closed && tracing() && !superseded) {
    WriteTrace(true, outlet);
  } else if (closed && tracing()) {
    // The trace by now holds what came from the next source.
    outlet.OnEvidence({open_->episode_id,
                       Trace(options_.before_points, Ns(options_.before_s)),
                       true});
  }
  if (closed) {
    replaces_alarm_ =
        superseded && transition.layer == Layer::kAudit && !transition.notice;
    open_.reset();
  }
}

void EpisodeTracker::End(const Transition& closed,
                         const std::shared_ptr<const ModelSet>& models,
                         EpisodeOutlet& outlet) {
  if (open_) {
    Emit(closed, models, outlet);
  }
}

void EpisodeTracker::ExpireRecovery(std::int64_t now_ns,
                                    EpisodeOutlet& outlet) {
  if (recovered_ && !seen_ && now_ns > recovered_->last_stamp_ns) {
    outlet.OnGap(
        {valve_id_, recovered_->last_stamp_ns, now_ns, "monitor_down"});
  }
  AbandonRecovery(EndReason::kUnknown, outlet);
}

void EpisodeTracker::AbandonRecovery(EndReason reason, EpisodeOutlet& outlet) {
  if (recovered_) {
    CloseRecovered(reason, seen_ ? accepted_stamp_ns_ : 0, outlet);
  }
}

void EpisodeTracker::Flush(EpisodeOutlet& outlet) {
  if (tracing() && trace_.size() > 0) {
    WriteTrace(false, outlet);
  }
}

void EpisodeTracker::WriteTrace(bool complete, EpisodeOutlet& outlet) {
  outlet.OnEvidence({open_->episode_id, trace_.Take(), complete});
  open_->tracing = !complete;
}

}  // namespace fdi::monitor
