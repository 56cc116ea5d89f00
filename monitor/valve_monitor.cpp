#include "monitor/valve_monitor.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/time_units.h"

namespace fdi::monitor {
namespace {

// A superseded source that has sent so many samples is not one that was just
// restarted. Either source is there until it was silent as long as costs an
// unknown valve its place (PipelineOptions::place_timeout), or until the valve
// is stale, whichever is later.
constexpr int kRivalSamples = 4;
constexpr std::chrono::seconds kSourcePatience{60};
// A valve that works settles, and is back where it was taught, within minutes.
constexpr std::int64_t kUnjudgedPatienceNs = 10 * kNsPerMinute;
constexpr double kTokensPerSample = 0.5;
constexpr double kTokensPerSecond = 5.0;
// Bounds of the period of a valve without a model set, measured from its
// samples.
constexpr std::int64_t kMinPeriodNs = 1'000'000;
constexpr std::int64_t kMaxPeriodNs = 3'600'000'000'000;

std::shared_ptr<const ModelSet> ModelsOf(
    const std::optional<EngineParts>& parts) {
  return parts ? parts->plan->shared_models() : nullptr;
}

}  // namespace

ValveMonitor::ValveMonitor(const std::string& id,
                           const std::optional<EngineParts>& parts,
                           const TraceOptions& options, LookWorker* looks,
                           std::shared_ptr<const SeverityCatalogue> severities,
                           AuditWorker* audits,
                           std::shared_ptr<const AlarmGate> gate)
    : id_(id),
      models_(ModelsOf(parts)),
      required_(parts ? parts->plan->required() : 0),
      looks_(looks),
      pending_(id, looks),
      severities_(std::move(severities)),
      tracker_(id, options, std::move(gate)),
      judge_(id_, audits, severities_) {
  if (parts) {
    decision_.emplace(*parts, Physics(), severities_);
  }
}

void ValveMonitor::Recover(const OpenEpisode& episode) {
  tracker_.Recover(episode);
  normal_by_audit_ = episode.layer == Layer::kAudit;
}

void ValveMonitor::Recover(EpisodeTracker tracker) {
  tracker_ = std::move(tracker);
  const OpenEpisode* const open = tracker_.recovering();
  normal_by_audit_ = open != nullptr && open->layer == Layer::kAudit;
}

LookWorker::Physics ValveMonitor::Physics() const {
  return looks_ != nullptr && models_ != nullptr ? looks_->PhysicsOf(*models_)
                                                 : nullptr;
}

bool ValveMonitor::RestartsEngine(const Sample& sample) const {
  const std::int64_t moved = sample.stamp_ns - stamp_ns_;
  const std::int64_t longest =
      decision_ ? std::llround(kGapPeriods * models_->sample_period_s * 1e9)
                : kMaxPeriodNs;
  return sample.source_id != source_id_ || sample.epoch != epoch_ ||
         moved <= 0 || moved > longest;
}

bool ValveMonitor::WithinRateLimit(const Sample& sample, TimePoint received) {
  // RecordPosition() takes the tokens, so only samples in order cost any:
  // repeated and late ones restart nothing.
  if (!RestartsEngine(sample)) {
    restart_tokens_ =
        std::min(restart_tokens_ + kTokensPerSample, kMaxRestartTokens);
    return true;
  }
  const std::chrono::duration<double> since = received - tokens_at_;
  tokens_at_ = received;
  restart_tokens_ = std::min(
      restart_tokens_ + kTokensPerSecond * std::max(since.count(), 0.0),
      kMaxRestartTokens);
  return restart_tokens_ >= 1.0;
}

void ValveMonitor::RecordPosition(const Sample& sample) {
  // Before the update: RestartsEngine() compares with the previous sample.
  restart_tokens_ -= RestartsEngine(sample) ? 1.0 : 0.0;
  source_id_ = sample.source_id;
  stamp_ns_ = sample.stamp_ns;
  epoch_ = sample.epoch;
}

ValveOutcome ValveMonitor::Step(const Sample& sample, std::uint64_t writer,
                                TimePoint received, EpisodeOutlet& outlet) {
  // A superseded source may return once its successor has gone. Otherwise
  // nothing would judge the valve, though its samples come.
  if (seen_ && (ended_ || received - received_ > SourcePatience())) {
    order_.ForgetSuperseded();
    if (decision_) {
      decision_->ForgetSuperseded();
    }
  }
  seen_ = true;
  const bool swapped = std::exchange(swapped_, false);
  if (!decision_) {
    const Intake intake = order_.Place(sample).intake;
    Hear(intake, writer, received, outlet);
    return StepLoop(sample, intake == Intake::kSuperseded, swapped, outlet);
  }
  RestoreOnce(sample.source_id);
  for (auto& [task, answer] : pending_.Collect()) {
    decision_->Answer(task, std::move(answer));
  }
  // An episode that this sample opens has the old name only if it resumes that
  // episode.
  if (!decision_->episode_open()) {
    decision_->Inherit(tracker_.Resumable(sample, *models_));
  }
  const Verdict& verdict = decision_->Step(sample);
  Hear(verdict.intake, writer, received, outlet);
  pending_.Request(decision_->TakeDue(), decision_->simulation());
  tracker_.Advance(sample, verdict, *models_, outlet);
  if (CountsAsTime(verdict)) {
    RecordJudged(verdict);
    RecordPosition(sample);
    coverage_.Add(sample.stamp_ns, verdict.quality, 1,
                  verdict.intake == Intake::kAccepted);
  }
  StepAudit(sample, verdict, outlet);
  // First the tracker, which opens the episode that looks and strengths belong
  // to. The evidence of an episode of the audit is the loop.
  if (!judge_.watch().episode_open() || !tracker_.tracing()) {
    tracker_.Step(sample, verdict, models_, outlet);
  }
  tracker_.Take(decision_->TakeLook(), outlet);
  tracker_.Take(decision_->TakeStrengths(), outlet);
  ConfirmNormal(verdict, outlet);
  const auto missing = static_cast<SignalMask>(required_ & ~sample.present);
  return {.verdict = verdict,
          .models = models_.get(),
          .model_swapped = swapped,
          .missing = missing,
          .period_s = period_s(),
          .unjudged_ns = unjudged_since_ns(),
          .found_normal = std::exchange(found_normal_, false),
          .notice = tracker_.notice(),
          .held = decision_->held()};
}

// A superseded publisher that goes on sending must neither end the stream of
// its successor nor keep a valve alive of which nothing else is heard.
void ValveMonitor::Hear(Intake intake, std::uint64_t writer, TimePoint received,
                        EpisodeOutlet& outlet) {
  if (intake == Intake::kSuperseded) {
    rival_samples_ = received - rival_at_ > SourcePatience()
                         ? 1
                         : std::min(rival_samples_ + 1, kRivalSamples);
    rival_at_ = received;
    return;
  }
  if (writer != writer_) {
    rival_samples_ = 0;  // Whoever it was may be the one that is heard now.
  }
  writer_ = writer;
  received_ = received;
  stale_counted_ = received;
  // An episode that this sample has ended keeps the time of its end.
  if (stale_ && episode_open()) {
    outlet.OnSilence(id_, std::nullopt);
  }
  stale_ = false;
  ended_ = false;
  closed_ = false;
}

bool ValveMonitor::Contested(TimePoint now) const {
  return rival_samples_ >= kRivalSamples && now - rival_at_ <= SourcePatience();
}

ValveMonitor::TimePoint::duration ValveMonitor::SourcePatience() const {
  return std::max<TimePoint::duration>(
      kSourcePatience,
      std::chrono::duration_cast<TimePoint::duration>(
          std::chrono::duration<double>(kGapPeriods * period_s())));
}

ValveOutcome ValveMonitor::StepLoop(const Sample& sample, bool superseded,
                                    bool swapped, EpisodeOutlet& outlet) {
  if (superseded) {
    return {judge_.Supersede(), models_.get(), swapped, 0, period_s()};
  }
  MeasurePeriod(sample.stamp_ns);
  const Verdict& verdict = judge_.Step(sample, period_s());
  const LoopWatch& watch = judge_.watch();
  swapped = swapped || models_ != watch.models();
  models_ = watch.models();
  if (!CountsAsTime(verdict)) {
    return {verdict, models_.get(), swapped, 0, period_s()};
  }
  RecordPosition(sample);
  coverage_.Add(sample.stamp_ns, verdict.quality);
  if (models_) {
    tracker_.Advance(sample, verdict, *models_, outlet);
  }
  TellOfLoop(sample, outlet);
  return {.verdict = verdict,
          .models = models_.get(),
          .model_swapped = swapped,
          .period_s = period_s(),
          .found_normal = std::exchange(found_normal_, false),
          .notice = tracker_.notice()};
}

// The loop of a valve with a model set is followed while the observers find
// nothing: their finding says more, and a window with it would be a second
// alarm of the same thing. After their episode a window begins anew.
void ValveMonitor::StepAudit(const Sample& sample, const Verdict& verdict,
                             EpisodeOutlet& outlet) {
  if (verdict.detected) {
    CloseAudit(EndReason::kSuperseded, outlet);
  } else if (judge_.beside_models() && CountsAsTime(verdict)) {
    judge_.Step(sample, period_s());
    TellOfLoop(sample, outlet);
  }
}

void ValveMonitor::TellOfLoop(const Sample& sample, EpisodeOutlet& outlet) {
  const LoopWatch& watch = judge_.watch();
  const Verdict& verdict = watch.verdict();
  // The evidence of an episode is the window; then a point now and again. At
  // all samples it would take more memory than everything else of a loop.
  const std::span<const Transition> told = verdict.Transitions();
  if (!told.empty() && told.front().kind == TransitionKind::kDetected) {
    std::vector<Sample> before = watch.Points();
    before.pop_back();  // This sample.
    tracker_.Remember(before, *watch.models());
  }
  if (!told.empty() ||
      (watch.episode_open() && watch.at_point() && tracker_.tracing())) {
    tracker_.Step(LoopWatch::Reduced(sample), verdict, watch.models(), outlet);
  }
  if (watch.episode_open() && watch.at_point()) {
    tracker_.Reweigh(verdict, outlet);  // Its evidence may be complete by now.
  }
  if (watch.found_normal() && tracker_.recovering() == nullptr) {
    normal_by_audit_ = false;
    found_normal_ = true;
    outlet.OnNormal(id_, verdict.stamp_ns);
  }
}

// The shorter one of the last two intervals: a gap is no period.
void ValveMonitor::MeasurePeriod(std::int64_t stamp_ns) {
  if (stamp_ns_ == 0 || stamp_ns <= stamp_ns_) {
    return;
  }
  const std::int64_t interval_ns =
      std::clamp(stamp_ns - stamp_ns_, kMinPeriodNs, kMaxPeriodNs);
  unassigned_period_ns_ =
      std::min(interval_ns, unassigned_interval_ns_.value_or(interval_ns));
  unassigned_interval_ns_ = interval_ns;
}

// Ten minutes, or twice what settling and rearming take at a slow period.
std::int64_t ValveMonitor::UnjudgedPatienceNs() const {
  const int samples =
      models_->decision.settling_samples + models_->validity.rearm_samples;
  return std::max<std::int64_t>(
      kUnjudgedPatienceNs,
      std::llround(2e9 * samples * models_->sample_period_s));
}

// Before RecordPosition(): stamp_ns_ is that of the sample before. Somebody has
// chosen another mode than AUTO. Behind a long silence, or a clock that was set
// back, time begins anew.
void ValveMonitor::RecordJudged(const Verdict& verdict) {
  const std::int64_t moved = verdict.stamp_ns - stamp_ns_;
  if (judged_ns_ == 0 || verdict.quality == Quality::kLive ||
      verdict.quality == Quality::kInhibited || moved < 0 ||
      moved > UnjudgedPatienceNs()) {
    judged_ns_ = verdict.stamp_ns;
  }
}

std::optional<std::int64_t> ValveMonitor::unjudged_since_ns() const {
  if (!decision_ || judged_ns_ == 0 || stale_ || ended_ ||
      stamp_ns_ - judged_ns_ <= UnjudgedPatienceNs()) {
    return std::nullopt;
  }
  return judged_ns_;
}

// An alarm whose data ended stays until the valve is seen to be normal: for as
// many samples as end an episode, once after each start or end of the stream.
// The audit alone finds normal again what the audit found.
void ValveMonitor::ConfirmNormal(const Verdict& verdict,
                                 EpisodeOutlet& outlet) {
  if (verdict.detected || tracker_.recovering() != nullptr ||
      (normal_by_audit_ && judge_.beside_models()) ||
      judge_.watch().episode_open()) {
    normal_samples_ = 0;
  } else if (verdict.intake == Intake::kAccepted &&
             verdict.quality == Quality::kLive &&
             normal_samples_ < models_->decision.clearing_samples &&
             ++normal_samples_ == models_->decision.clearing_samples) {
    found_normal_ = true;
    outlet.OnNormal(id_, verdict.stamp_ns);
  }
}

void ValveMonitor::RestoreOnce(std::uint64_t source_id) {
  if (saved_ && saved_->source_id == source_id) {
    decision_->Restore(saved_->bytes);
  }
  saved_.reset();
}

void ValveMonitor::HoldIsolation(bool hold) {
  isolation_held_ = hold;
  if (decision_) {
    decision_->HoldIsolation(hold);
  }
}

void ValveMonitor::TakeCheckpoint(Checkpoint& checkpoint) {
  coverage_.DrainInto(id_, period_s(), checkpoint.coverage);
  if (decision_ && seen_ && !stale_ && !ended_) {
    checkpoint.accumulators.push_back(
        {id_, source_id_, models_->content_hash, stamp_ns_, decision_->Save()});
  }
}

double ValveMonitor::period_s() const {
  return decision_ ? models_->sample_period_s
                   : static_cast<double>(unassigned_period_ns_) / 1e9;
}

bool ValveMonitor::EndStream(std::uint64_t writer, EpisodeOutlet& outlet) {
  if (ended_ || (seen_ && writer != writer_)) {
    return false;
  }
  Close(EndReason::kStreamEnded, outlet);
  tracker_.AbandonRecovery(EndReason::kStreamEnded, outlet);
  ended_ = true;
  stale_ = false;
  return true;
}

bool ValveMonitor::Adopt(const std::optional<EngineParts>& parts,
                         EpisodeOutlet& outlet) {
  std::shared_ptr<const ModelSet> models = ModelsOf(parts);
  // A hash of 0 identifies nothing: the set does not come from a store.
  if ((!models && !decision_) || (models && models == models_) ||
      (models && models_ && models->content_hash != 0 &&
       models->content_hash == models_->content_hash)) {
    return false;
  }
  // The old set has to last until the end of its episode is recorded with it.
  const std::shared_ptr<const ModelSet> old =
      std::exchange(models_, std::move(models));
  const auto end = [&](const std::optional<Transition>& closed) {
    if (closed) {
      tracker_.End(*closed, old, outlet);
    }
  };
  if (parts && decision_) {
    end(decision_->Adopt(*parts, Physics()));
  } else if (parts) {
    if (!judge_.beside_models()) {  // Else what the audit has found goes on.
      CloseAudit(EndReason::kModelChanged, outlet);
    }
    decision_.emplace(*parts, Physics(), severities_);
    decision_->HoldIsolation(isolation_held_);
  } else {
    end(decision_->End(EndReason::kModelChanged));
    decision_.reset();
    // The period is measured anew, beginning with that of the old set.
    unassigned_period_ns_ = std::llround(old->sample_period_s * 1e9);
    unassigned_interval_ns_.reset();
    stamp_ns_ = 0;
  }
  judged_ns_ = 0;
  pending_.Clear();
  required_ = parts ? parts->plan->required() : SignalMask{0};
  swapped_ = true;
  return true;
}

bool ValveMonitor::CheckStale(TimePoint now, EpisodeOutlet& outlet) {
  const std::chrono::duration<double> limit(kGapPeriods * period_s());
  if (!seen_ || ended_ || stale_ || now - received_ <= limit) {
    return false;
  }
  stale_ = true;
  if (episode_open()) {
    outlet.OnSilence(id_, stamp_ns_);
  }
  return true;
}

void ValveMonitor::Flush(EpisodeOutlet& outlet) {
  tracker_.Flush(outlet);
  if (episode_open()) {
    outlet.OnSilence(id_, stamp_ns_);
  }
}

std::uint64_t ValveMonitor::CountStale(TimePoint now) {
  if (!stale_) {
    return 0;
  }
  const std::chrono::duration<double> silence = now - stale_counted_;
  const double periods = std::floor(silence.count() / period_s());
  if (periods < 1.0) {
    return 0;
  }
  const std::chrono::duration<double> counted(periods * period_s());
  // Whole periods only, so that the remainder counts at the next call.
  stale_counted_ += std::chrono::duration_cast<TimePoint::duration>(counted);
  // Silence is measured by arrival, and dated by extending the last stamp.
  const std::chrono::nanoseconds since = stale_counted_ - received_;
  const auto samples = static_cast<std::uint64_t>(periods);
  coverage_.Add(stamp_ns_ + since.count(), Quality::kStale, samples);
  return samples;
}

void ValveMonitor::CheckTimeout(TimePoint now,
                                std::chrono::milliseconds timeout,
                                EpisodeOutlet& outlet) {
  if ((stale_ || ended_) && now - received_ > timeout) {
    Close(EndReason::kStaleTimeout, outlet);
    tracker_.AbandonRecovery(EndReason::kStaleTimeout, outlet);
  }
}

// For a valve that sends, the time of its samples decides instead:
// EpisodeTracker::TryRecovery().
void ValveMonitor::ExpireRecovery(std::int64_t now_ns, EpisodeOutlet& outlet) {
  if (!seen_ || stale_ || ended_ || !decision_) {
    tracker_.ExpireRecovery(now_ns, outlet);
  }
}

void ValveMonitor::Close(EndReason reason, EpisodeOutlet& outlet) {
  closed_ = true;
  normal_samples_ = 0;
  CloseAudit(reason, outlet);
  if (const auto closed = decision_ ? decision_->End(reason) : std::nullopt) {
    pending_.Clear();
    tracker_.End(*closed, models_, outlet);
  }
}

void ValveMonitor::CloseAudit(EndReason reason, EpisodeOutlet& outlet) {
  if (const std::optional<Transition> closed = judge_.End(reason)) {
    normal_by_audit_ = reason != EndReason::kSuperseded;
    tracker_.End(*closed, judge_.watch().models(), outlet);
  }
}

}  // namespace fdi::monitor
