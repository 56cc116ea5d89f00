#include "monitor/episode_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "diagnosis/model/model_set.h"

namespace fdi::monitor {
namespace {

constexpr double kResumeWindowS = 60.0;
// After a silence of as many periods a valve is STALE.
constexpr double kGapPeriods = 3.0;

std::int64_t Ns(double seconds) {
  return std::llround(seconds * 1e9);
}

bool EndsEpisode(const Transition& transition) {
  return transition.kind == TransitionKind::kCleared ||
         transition.kind == TransitionKind::kClosed;
}

void Forget(std::vector<FaultEvent>& events, std::uint64_t episode_id) {
  std::erase_if(events, [episode_id](const FaultEvent& event) {
    return event.episode_id == episode_id;
  });
}

}  // namespace

EpisodeTracker::EpisodeTracker(std::string valve_id,
                               const TraceOptions& options)
    : valve_id_(std::move(valve_id)),
      options_(options),
      trace_(options.before_points, Ns(options.before_s)) {}

void EpisodeTracker::Recover(const OpenEpisode& episode) {
  recovered_ = episode;
}

std::optional<FaultSet> EpisodeTracker::StandBy(bool standby,
                                                EpisodeOutlet& outlet) {
  if (std::exchange(standby_, standby) == standby) {
    return {};
  }
  if (standby && open_ && recovered_) {  // Both led.
    Follow(*recovered_, outlet);
  } else if (standby && open_ && !IsOver(open_->episode)) {
    open_->teller = Teller::kLeader;
    recovered_ = open_->episode;
    by_leader_ = true;
  }
  if (standby) {
    return {};
  }
  // What was over here before the leader could find it was nothing.
  if (!open_ && !untold_.empty() &&
      accepted_stamp_ns_ - untold_.back().transition.stamp_ns > window_ns_) {
    untold_.clear();
  }
  TellAll(ends_, outlet);
  TellAll(untold_, outlet);
  // The time within which it has to be detected again begins now.
  first_stamp_ns_ = std::max(first_stamp_ns_, accepted_stamp_ns_);
  if (!open_ || std::exchange(open_->teller, Teller::kWe) != Teller::kLeader) {
    return {};
  }
  if (recovered_ && recovered_->episode_id == open_->episode.episode_id) {
    open_->episode = *std::exchange(recovered_, std::nullopt);
  }
  return open_->episode.faults;
}

bool EpisodeTracker::Adopt(const FaultEvent& event, EpisodeOutlet& outlet) {
  const Transition& said = event.transition;
  const bool here = open_ && open_->episode.episode_id == event.episode_id;
  const bool known = recovered_ && recovered_->episode_id == event.episode_id;
  if (said.kind == TransitionKind::kClosed) {
    Forget(ends_, event.episode_id);
    if (known) {
      recovered_.reset();
    }
    if (here && open_->tracing) {
      WriteTrace(true, outlet);
    }
    if (event.source_id != ended_.source_id ||
        said.stamp_ns >= ended_.ended_ns) {
      ended_ = {valve_id_, event.source_id, event.episode_id, said.stamp_ns};
    }
    return false;
  }
  by_leader_ = by_leader_ || known;
  // Later words say more than a detection.
  if (IsOver(event) || (here && !standby_) ||
      (known && said.kind == TransitionKind::kDetected)) {
    return false;
  }
  OpenEpisode episode = OpenEpisodeOf(event);
  if (known) {
    episode.last_stamp_ns =
        std::max(episode.last_stamp_ns, recovered_->last_stamp_ns);
  } else {
    // The time within which it has to be detected again begins now, not with
    // the first sample of this session.
    first_stamp_ns_ = std::max(first_stamp_ns_, accepted_stamp_ns_);
  }
  const bool linked = open_ && recovered_ &&
                      open_->episode.episode_id == recovered_->episode_id;
  if (recovered_ && !known && !linked) {
    Supersede(*std::exchange(recovered_, std::nullopt),
              episode.detection_stamp_ns, outlet);
  }
  recovered_ = episode;
  by_leader_ = true;
  if (!open_) {
    untold_.clear();
  }
  // Of a valve with a model set one may be the audit's.
  if (!open_ || !standby_ || open_->episode.source_id != event.source_id ||
      open_->episode.model_hash != event.model_hash) {
    return false;
  }
  Follow(episode, outlet);
  return IsIsolation(said.kind);
}

// A repeat of what was before the last end. The stamps of two sources are not
// compared.
bool EpisodeTracker::IsOver(const FaultEvent& event) const {
  const bool goes_on =
      (open_ && open_->episode.episode_id == event.episode_id) ||
      (recovered_ && recovered_->episode_id == event.episode_id);
  return event.episode_id == ended_.episode_id ||
         (!goes_on && event.source_id == ended_.source_id &&
          event.transition.stamp_ns <= ended_.ended_ns);
}

// What is open here is the episode of the leader.
void EpisodeTracker::Follow(const OpenEpisode& said, EpisodeOutlet& outlet) {
  const OpenEpisode ours = std::exchange(open_->episode, said);
  const Teller teller = std::exchange(open_->teller, Teller::kLeader);
  untold_.clear();
  if (ours.episode_id == said.episode_id) {
    return;
  }
  if (teller != Teller::kNobody && !IsOver(ours)) {
    if (open_->tracing) {
      outlet.OnEvidence({ours.episode_id, trace_.Take(), true});
    }
    Supersede(ours, said.detection_stamp_ns, outlet);
  }
  open_->tracing = true;
}

// Both monitors date the end with the later detection, so that it is the same
// in both histories.
void EpisodeTracker::Supersede(const OpenEpisode& episode,
                               std::int64_t other_detection_ns,
                               EpisodeOutlet& outlet) {
  Forget(ends_, episode.episode_id);
  Tell(EndOf(episode, EndReason::kSuperseded,
             std::max(episode.detection_stamp_ns, other_detection_ns)),
       outlet);
}

void EpisodeTracker::Tell(FaultEvent event, EpisodeOutlet& outlet) {
  if (event.transition.kind == TransitionKind::kClosed) {
    ended_ = {valve_id_, event.source_id, event.episode_id,
              event.transition.stamp_ns};
    if (recovered_ && IsOver(*recovered_)) {
      recovered_.reset();
    }
  } else if (open_ && open_->episode.episode_id == event.episode_id) {
    open_->episode = OpenEpisodeOf(event);
  }
  outlet.OnEvent(std::move(event));
}

void EpisodeTracker::TellAll(std::vector<FaultEvent>& events,
                             EpisodeOutlet& outlet) {
  for (FaultEvent& event : std::exchange(events, {})) {
    Tell(std::move(event), outlet);
  }
}

// The leader does not find it.
void EpisodeTracker::TellIfAlone(std::int64_t stamp_ns, EpisodeOutlet& outlet) {
  if (open_ && open_->teller == Teller::kNobody &&
      stamp_ns - open_->episode.detection_stamp_ns > window_ns_) {
    open_->teller = Teller::kWe;
    TellAll(untold_, outlet);
  }
}

const OpenEpisode* EpisodeTracker::Resumable(std::uint64_t source_id,
                                             const ModelSet& models) const {
  return recovered_ && recovered_->source_id == source_id &&
                 recovered_->model_hash == models.content_hash
             ? &*recovered_
             : nullptr;
}

// TryRecovery() follows RecordGap(), which needs to know whether any sample
// came before.
void EpisodeTracker::Advance(const Sample& sample, const Verdict& engine,
                             const ModelSet& models, EpisodeOutlet& outlet) {
  if (!OutOfOrder(engine.intake)) {
    window_ns_ =
        Ns(std::max(kResumeWindowS, 2.0 * models.decision.settling_samples *
                                        models.sample_period_s));
    RecordGap(sample, engine, models, outlet);
    TryRecovery(sample, models, outlet);
    TellIfAlone(sample.stamp_ns, outlet);
    source_id_ = sample.source_id;
    seq_ = sample.seq;
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
  if (IsRecorded() && open_->tracing &&
      !trace_.Continues(sample, verdict, channels, faults)) {
    WriteTrace(false, outlet);
  }
  // before_s bounds what precedes a detection. Of an open episode nothing may
  // be dropped before it is written, which takes points_per_write samples.
  // What an audit rests on is longer, and given to Remember() when it counts.
  trace_.set_span_ns((open_ && open_->tracing) || models->channels.empty()
                         ? std::numeric_limits<std::int64_t>::max()
                         : Ns(options_.before_s));
  trace_.Push(sample, verdict, channels, faults);
  for (const Transition& transition : verdict.Transitions()) {
    Take(transition, verdict, models, outlet);
  }
  FollowName(verdict, *models);
  FollowUnknown(verdict, *models);
  if (IsRecorded() && open_->tracing) {
    const bool complete = sample.stamp_ns > open_->trace_until_ns;
    if (complete || verdict.transition_count > 0 ||
        trace_.size() >= static_cast<std::size_t>(options_.points_per_write)) {
      WriteTrace(complete, outlet);
    }
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
  if (look && IsRecorded() && !IsOver(open_->episode)) {
    look->episode_id = open_->episode.episode_id;
    outlet.OnLook(std::move(*look));
  }
}

void EpisodeTracker::Take(const std::vector<StrengthPoint>& points,
                          EpisodeOutlet& outlet) {
  for (StrengthPoint point : points) {
    if (IsRecorded() && !IsOver(open_->episode)) {
      point.episode_id = open_->episode.episode_id;
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
  if (!recovered_ || WaitsForLeader()) {
    return;
  }
  // A standby waits for longer: the leader ends it first.
  const std::int64_t patience_ns = (standby_ ? 2 : 1) * window_ns_;
  // The bits of its faults mean nothing in another model set. What the audit
  // found, it does not find again within that time.
  if (recovered_->model_hash != models.content_hash &&
      recovered_->layer != Layer::kAudit) {
    CloseRecovered(EndReason::kModelChanged, sample.stamp_ns, outlet);
  } else if (recovered_->model_hash != models.content_hash ||
             recovered_->source_id != sample.source_id ||
             sample.stamp_ns - first_stamp_ns_ > patience_ns) {
    CloseRecovered(EndReason::kUnknown, sample.stamp_ns, outlet);
  }
}

void EpisodeTracker::CloseRecovered(EndReason reason, std::int64_t stamp_ns,
                                    EpisodeOutlet& outlet) {
  const OpenEpisode episode = *std::exchange(recovered_, std::nullopt);
  if (open_) {  // The other monitor led, too, and has not told of its end.
    Supersede(episode, open_->episode.detection_stamp_ns, outlet);
    return;
  }
  // stamp_ns is 0 if this session saw no sample.
  Tell(EndOf(episode, reason, std::max(stamp_ns, episode.last_stamp_ns)),
       outlet);
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
                           const ModelSet& models, EpisodeOutlet& outlet) {
  open_ = Open{};
  open_->trace_until_ns = transition.stamp_ns + Ns(options_.after_detection_s);
  untold_.clear();
  if (Resumable(verdict.source_id, models) != nullptr) {
    open_->episode = *recovered_;
    open_->faults = recovered_->faults;
    open_->candidates = recovered_->candidates;
    Forget(ends_, recovered_->episode_id);  // It was not over.
    if (!WaitsForLeader()) {
      outlet.OnResumed(*recovered_, verdict.stamp_ns);
    }
    if (standby_) {
      open_->teller = Teller::kLeader;
      by_leader_ = true;
    } else {
      recovered_.reset();
    }
    return true;
  }
  open_->teller = standby_ ? Teller::kNobody : Teller::kWe;
  open_->episode.source_id = verdict.source_id;
  open_->episode.model_hash = models.content_hash;
  open_->episode.detection_stamp_ns = transition.detection_stamp_ns;
  open_->episode.episode_id =
      EpisodeId(valve_id_, verdict.source_id, transition.detection_stamp_ns);
  // A source that sends the same stamps once more is judged once more.
  if (!standby_ && IsOver(open_->episode)) {
    ended_ = {};
  }
  return false;
}

void EpisodeTracker::Take(const Transition& transition, const Verdict& verdict,
                          const std::shared_ptr<const ModelSet>& models,
                          EpisodeOutlet& outlet) {
  // The earlier session has reported the detection of what goes on.
  if (transition.kind == TransitionKind::kDetected &&
      Begin(transition, verdict, *models, outlet)) {
    return;
  }
  if (!open_) {
    return;
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

// The name by the word of the leader comes without a transition.
void EpisodeTracker::FollowName(const Verdict& verdict,
                                const ModelSet& models) {
  if (open_ && open_->teller == Teller::kLeader && verdict.detected &&
      verdict.isolated != open_->faults) {
    open_->faults = verdict.isolated;
    open_->candidates = CandidatesOf(models, verdict, verdict.isolated);
  }
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
  transition.detection_stamp_ns = open_->episode.detection_stamp_ns;
  FaultEvent event;
  event.valve_id = valve_id_;
  event.source_id = open_->episode.source_id;
  event.seq = seq_;
  event.episode_id = open_->episode.episode_id;
  event.transition = transition;
  event.candidates = open_->candidates;
  event.models = models;
  event.model_set = models->name;
  event.model_version = models->version;
  event.model_hash = models->content_hash;
  if (!IsOver(open_->episode)) {
    if (open_->teller == Teller::kWe) {
      Tell(std::move(event), outlet);
    } else if (open_->teller == Teller::kNobody) {
      untold_.push_back(std::move(event));
    } else if (EndsEpisode(transition)) {
      ends_.push_back(std::move(event));
    }
  }
  if (closed && IsRecorded() && open_->tracing && !superseded) {
    WriteTrace(true, outlet);
  } else if (closed && IsRecorded() && open_->tracing) {
    // What is in the trace by now came from the next source.
    outlet.OnEvidence({open_->episode.episode_id,
                       Trace(options_.before_points, Ns(options_.before_s)),
                       true});
  }
  if (closed && recovered_ && open_->teller == Teller::kWe) {
    CloseRecovered(EndReason::kSuperseded, transition.stamp_ns, outlet);
  }
  if (closed) {
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
  if (recovered_ && !WaitsForLeader() && !seen_ &&
      now_ns > recovered_->last_stamp_ns) {
    outlet.OnGap(
        {valve_id_, recovered_->last_stamp_ns, now_ns, "monitor_down"});
  }
  AbandonRecovery(EndReason::kUnknown, outlet);
}

void EpisodeTracker::AbandonRecovery(EndReason reason, EpisodeOutlet& outlet) {
  if (recovered_ && !WaitsForLeader()) {
    CloseRecovered(reason, seen_ ? accepted_stamp_ns_ : 0, outlet);
  }
}

void EpisodeTracker::Flush(EpisodeOutlet& outlet) {
  if (IsRecorded() && open_->tracing && trace_.size() > 0) {
    WriteTrace(false, outlet);
  }
}

void EpisodeTracker::WriteTrace(bool complete, EpisodeOutlet& outlet) {
  outlet.OnEvidence({open_->episode.episode_id, trace_.Take(), complete});
  open_->tracing = !complete;
}

}  // namespace fdi::monitor
