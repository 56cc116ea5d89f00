#include "monitor/pipeline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <utility>

#include <malloc.h>

#include "base/error.h"
#include "base/printable.h"
#include "diagnosis/loop/loop_watch.h"
#include "diagnosis/model/quality_count.h"
#include "diagnosis/records/valve_glob.h"
#include "monitor/guard.h"

namespace fdi::monitor {
namespace {

constexpr std::size_t kRememberedRefusals = 65536;
constexpr std::chrono::milliseconds kPollPeriod{250};
// Under load Poll() comes only after thousands of samples, and a slow
// subscriber of fdi/v1/DecisionBatch holds up each of them. A thread that gets
// through them slowly is not stalled.
constexpr std::uint64_t kBeatSamples = 64;

// Indexed by Intake.
constexpr std::array<LogId, kIntakeCount> kRejectionIds{
    LogId::kMissingSignal /* accepted, and yet not judged */,
    LogId::kRepeat,
    LogId::kLate,
    LogId::kSuperseded,
    LogId::kBadQuality,
    LogId::kNotFinite,
    LogId::kRange,
    LogId::kUnit,
    LogId::kPeriod};

// "F|T1"
std::string SignalNames(SignalMask signals) {
  std::string names;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      names.append(names.empty() ? "" : "|").append(SignalName(signal));
    }
  }
  return names;
}

// The valve that is not judged for longest stands for all.
void CountUnjudged(const ValveMonitor& monitor, ValveCensus& census) {
  const std::optional<std::int64_t> since_ns = monitor.unjudged_since_ns();
  if (!since_ns) {
    return;
  }
  if (census.unjudged++ > 0 && *since_ns >= census.unjudged_ns) {
    return;
  }
  const Verdict& verdict = monitor.verdict();
  census.unjudged_valve = monitor.id();
  census.unjudged_ns = *since_ns;
  census.unjudged_reason =
      WhyUnjudged(verdict.quality, verdict.intake, verdict.uncovered);
}

}  // namespace

LookReport LookReportOf(const MonitorContext& context) {
  return [context](LookFate fate, const std::string& whose,
                   std::string_view reason) {
    switch (fate) {
      case LookFate::kTaken:
        context.counters.Add(Counter::kLooks);
        break;
      case LookFate::kDropped:
        context.counters.Add(Counter::kLooksDropped);
        context.log.Report(LogId::kLookDropped, "second_look_dropped",
                           [&whose] { return whose; });
        break;
      case LookFate::kFailed:
        context.counters.Add(Counter::kLooksFailed);
        context.log.Report(LogId::kLookFailed, "second_look_failed", [&] {
          return whose + " reason=" + LogValue(reason);
        });
        break;
    }
  };
}

Pipeline::Pipeline(PipelineOptions options, PipelineSinks sinks,
                   std::shared_ptr<const ModelResolver> resolver,
                   const MonitorContext& context)
    : options_(std::move(options)),
      decisions_(sinks.decisions),
      resolver_(std::move(resolver)),
      context_(context),
      counters_(context.counters),
      log_(context.log),
      journal_(sinks.history, sinks.events, context, options_.journal),
      looks_(options_.second_look
                 ? std::make_unique<LookWorker>(LookReportOf(context_))
                 : nullptr),
      audits_(options_.loop_audit
                  ? std::make_unique<AuditWorker>(options_.audit_all_loops)
                  : nullptr) {}

Pipeline::~Pipeline() {
  try {
    Stop();
  } catch (...) {
    // The error is reported only to those who call Stop() themselves.
  }
}

void Pipeline::Attach(std::unique_ptr<ValveListener> listener) {
  Attach(*listener);
  owned_.push_back(std::move(listener));
}

template <typename Call>
void Pipeline::Tell(Call call) {
  for (ValveListener* const listener : listeners_) {
    Guarded(counters_, log_, listener->name(), [&] { call(*listener); });
  }
}

void Pipeline::Start(const std::vector<OpenEpisode>& open,
                     std::vector<Accumulator> accumulators) {
  // All reservations come before the first sample, so that unknown ids cannot
  // take the slots of known valves.
  for (const std::string& id : resolver_->AssignedValves()) {
    Reserve(id);
  }
  for (const OpenEpisode& episode : open) {
    Reserve(episode.valve_id);
  }
  for (Accumulator& accumulator : accumulators) {
    Reserve(accumulator.valve_id);
    accumulators_[accumulator.valve_id] = std::move(accumulator);
  }
  last_poll_ = last_checkpoint_ = std::chrono::steady_clock::now();
  Recover(open);
  started_ = true;
  journal_.Start();
  if (looks_) {
    looks_->Start();
  }
  if (audits_) {
    audits_->Start();
  }
}

// A valve has at most one open episode; the older of two is closed.
void Pipeline::Recover(const std::vector<OpenEpisode>& episodes) {
  for (const OpenEpisode& episode : episodes) {
    EpisodeTracker& tracker =
        recovered_
            .try_emplace(episode.valve_id, episode.valve_id, options_.trace,
                         options_.alarms)
            .first->second;
    OpenEpisode newer = episode;
    if (const OpenEpisode* known = tracker.recovering()) {
      OpenEpisode older = *known;
      if (older.detection_stamp_ns > newer.detection_stamp_ns) {
        std::swap(older, newer);
      }
      tracker.Recover(older);
      tracker.AbandonRecovery(EndReason::kUnknown, journal_);
    }
    tracker.Recover(newer);
    // Until its valve sends and it goes on, nothing confirms it.
    journal_.OnSilence(newer.valve_id, newer.last_stamp_ns);
  }
  if (!episodes.empty()) {
    recovery_deadline_ = last_poll_ + options_.recovery_window;
  }
}

void Pipeline::Stop() {
  if (!std::exchange(started_, false)) {
    return;
  }
  FirstError errors;
  errors.Try([this] {
    // Silence is counted up to now, then the evidence is flushed: the last
    // checkpoint must be complete before the journal stops.
    CheckSilentValves(std::chrono::steady_clock::now());
    for (const std::unique_ptr<Valve>& valve : valves_) {
      valve->monitor.Flush(journal_);
    }
    TakeCheckpoint(false);
  });
  if (looks_) {
    errors.Try([this] { looks_->Stop(); });
  }
  if (audits_) {
    errors.Try([this] { audits_->Stop(); });
  }
  errors.Try([this] { journal_.Stop(); });
  errors.Rethrow();
}

// @returns null for a valve that is not admitted, which is counted.
Pipeline::Valve* Pipeline::Admit(std::string_view valve_id) {
  const auto known = by_id_.find(valve_id);
  if (known != by_id_.end()) {
    return known->second;
  }
  if (valve_id.empty() || valve_id.size() > kMaxIdLength) {
    counters_.Add(Counter::kBadIds);
    log_.Report(LogId::kBadId, "sample_rejected", [&] {
      return "reason=valve_id length=" + std::to_string(valve_id.size());
    });
    return nullptr;
  }
  if (!GlobMatches(options_.valve_glob, valve_id)) {
    counters_.Add(Counter::kFilteredSamples);
    return nullptr;
  }
  // Reserved slots stay free for known valves: with V valves, R of them and P
  // places, an unknown valve needs V + R < P, a known one only V < P.
  const auto places = static_cast<std::size_t>(options_.max_valves);
  const bool is_known = reserved_.contains(valve_id);
  const std::size_t kept = is_known ? 0 : reserved_.size();
  if (valves_.size() + kept < places || FreeSlot(is_known)) {
    return &AddValve(valve_id);
  }
  return Refuse(valve_id, valves_.size() < places ? "reserved" : "max_valves");
}

// The valve keeps its slot, or is guaranteed one when its first sample comes.
void Pipeline::Reserve(const std::string& valve_id) {
  if (const auto found = by_id_.find(valve_id); found != by_id_.end()) {
    found->second->known = true;
  } else if (GlobMatches(options_.valve_glob, valve_id)) {
    reserved_.insert(valve_id);
  }
}

// Only unknown valves without an episode, open or to be resumed, can be
// evicted.
bool Pipeline::IsEvictable(const Valve& valve) const {
  return !valve.known && !valve.monitor.episode_open() &&
         !valve.monitor.recovering();
}

// Evicts an unknown valve that is silent or, in favour of a known valve, the
// one that has been silent longest. @returns whether a slot was freed.
//
// An unknown valve looks only at idle_, because anybody can send a new id with
// every sample: a search through all valves would cost O(valves) for each of
// them. For a known valve, one of a fixed list, the search is worth its cost.
bool Pipeline::FreeSlot(bool for_known) {
  const TimePoint now = last_poll_;
  while (!idle_.empty()) {
    Valve* const valve = idle_.back();
    idle_.pop_back();
    // idle_ is as old as the last Poll(): the valve may have sent since.
    if (IsEvictable(*valve) &&
        valve->monitor.Silence(now) >= options_.place_timeout) {
      Evict(*valve);
      return true;
    }
  }
  Valve* longest = nullptr;
  for (const std::unique_ptr<Valve>& valve : valves_) {
    if (for_known && IsEvictable(*valve) &&
        (longest == nullptr ||
         valve->monitor.Silence(now) > longest->monitor.Silence(now))) {
      longest = valve.get();
    }
  }
  if (longest != nullptr) {
    Evict(*longest);
  }
  return longest != nullptr;
}

void Pipeline::Evict(Valve& valve) {
  const std::string id = valve.monitor.id();
  log_.Line(LogLevel::kDebug, "valve_forgotten valve=" + LogValue(id));
  // The valve is gone after this, so what it has gathered since the last
  // checkpoint is stored now.
  Checkpoint checkpoint;
  valve.monitor.Flush(journal_);
  valve.monitor.TakeCheckpoint(checkpoint);
  Tell([&](ValveListener& each) { each.OnRemoved(id, checkpoint); });
  journal_.Commit(std::move(checkpoint));
  decisions_.Remove(id);
  {
    const MutexLock lock(mutex_);
    std::erase(names_, id);
  }
  by_id_.erase(id);
  std::erase(idle_, &valve);
  std::erase_if(valves_,
                [&valve](const auto& each) { return each.get() == &valve; });
}

// Only a bounded set of hashes is kept of refused ids.
Pipeline::Valve* Pipeline::Refuse(std::string_view valve_id,
                                  const char* reason) {
  if (refused_.size() < kRememberedRefusals) {
    refused_.insert(Hash{}(valve_id));
  }
  counters_.Add(Counter::kRefusedSamples);
  log_.Report(LogId::kValveRefused, "valve_refused", [&] {
    return "valve=" + LogValue(valve_id) + " reason=" + reason +
           " max_valves=" + std::to_string(options_.max_valves) +
           " refused_valves=" + std::to_string(refused_.size());
  });
  return nullptr;
}

Pipeline::Valve& Pipeline::AddValve(std::string_view valve_id) {
  const std::string id(valve_id);
  std::optional<EngineParts> parts;
  Resolve(id, parts);
  log_.Line(LogLevel::kDebug,
            "valve_seen valve=" + LogValue(id) + " model_set=" +
                (parts ? NameOf(parts->plan->models()) : "none"));
  auto valve = std::make_unique<Valve>(
      Valve{ValveMonitor(id, parts, options_.trace, looks_.get(),
                         options_.severities, audits_.get(), options_.alarms),
            reserved_.erase(id) > 0});
  valve->monitor.HoldIsolation(resolver_->IsolationHeld(id));
  if (auto known = recovered_.extract(id)) {
    valve->monitor.Recover(std::move(known.mapped()));
  }
  if (auto saved = accumulators_.extract(id)) {
    valve->monitor.Resume(std::move(saved.mapped()));
  }
  by_id_[id] = valve.get();
  {
    const MutexLock lock(mutex_);
    names_.push_back(id);
  }
  return *valves_.emplace_back(std::move(valve));
}

// @returns false if the model set of the valve cannot be loaded.
bool Pipeline::Resolve(const std::string& valve_id,
                       std::optional<EngineParts>& parts) {
  parts.reset();
  try {
    if (const auto models = resolver_->ModelsFor(valve_id)) {
      parts = plans_.For(models);
    }
  } catch (const std::exception& error) {
    counters_.Add(Counter::kModelFailures);
    const std::string reason = error.what();
    log_.Report(
        LogId::kModelFailure, "model_set_unusable",
        [&] {
          return "valve=" + LogValue(valve_id) + " reason=" + LogValue(reason);
        },
        LogLevel::kError);
    return false;
  }
  if (!parts) {
    log_.Report(LogId::kUnassigned, "valve_unassigned",
                [&valve_id] { return "valve=" + LogValue(valve_id); });
  }
  return true;
}

void Pipeline::OnSample(std::string_view valve_id, const Sample& sample,
                        std::uint64_t writer, TimePoint received) {
  if (offered_++ % kBeatSamples == 0) {
    pulse_.Beat();
  }
  counters_.Add(Counter::kReceived);
  Valve* const valve = Admit(valve_id);
  if (valve == nullptr) {
    return;
  }
  if (!valve->monitor.WithinRateLimit(sample, received)) {
    counters_.Add(Counter::kOverShare);
    log_.Report(LogId::kOverShare, "sample_rejected", [valve] {
      return "reason=over_share valve=" + LogValue(valve->monitor.id());
    });
    return;
  }
  ValveOutcome outcome =
      valve->monitor.Step(sample, writer, received, journal_);
  outcome.contested = valve->monitor.Contested(received);
  Count(*valve, sample, outcome);
  // A sample out of order did not affect the engine, so its verdict is that of
  // an earlier sample, which is on the bus already.
  if (!OutOfOrder(outcome.verdict.intake)) {
    Publish(*valve, outcome);
  }
  Tell([&](ValveListener& each) {
    each.OnVerdict(valve->monitor.id(), sample, outcome);
  });
}

void Pipeline::OnStreamEnded(std::string_view valve_id, std::uint64_t writer) {
  // The end of a stream that was never seen evicts no valve.
  const bool expected =
      by_id_.contains(valve_id) || reserved_.contains(valve_id);
  Valve* const valve = expected ? Admit(valve_id) : nullptr;
  if (valve == nullptr || !valve->monitor.EndStream(writer, journal_)) {
    return;
  }
  // Its engine has no episode any more: the last verdict would say NORMAL.
  decisions_.Remove(valve->monitor.id());
  Tell([&](ValveListener& each) {
    each.OnSilence(valve->monitor.id(), Silence::kEnded);
  });
}

void Pipeline::Count(Valve& valve, const Sample& sample,
                     const ValveOutcome& outcome) {
  const Verdict& verdict = outcome.verdict;
  counters_.Add(outcome.models != nullptr ? Counter::kDiagnosed
                                          : Counter::kUnassigned);
  counters_.Add(verdict.intake);
  if (verdict.initialised) {
    counters_.Add(Counter::kInitialisations);
  }
  if (CountsAsTime(verdict)) {
    counters_.Add(verdict.quality);
  }
  // The engine accepts a sample with missing signals; the channels that need
  // them abstain. Without any channel left nothing is judged, which needs a
  // reason.
  const bool unjudged =
      verdict.quality == Quality::kBadInput && outcome.missing != 0;
  if (verdict.intake == Intake::kAccepted && !unjudged) {
    const SignalMask missing = outcome.models ? outcome.missing : SignalMask{0};
    if (std::exchange(valve.missing, missing) != missing && missing != 0) {
      log_.Report(LogId::kPartlyJudged, "valve_partly_judged", [&] {
        return "valve=" + LogValue(valve.monitor.id()) +
               " missing=" + SignalNames(outcome.missing);
      });
    }
    const SignalMask held = std::exchange(valve.held, outcome.held);
    if ((outcome.held & ~held) != 0) {
      log_.Report(LogId::kHeld, "readings_held", [&] {
        return "valve=" + LogValue(valve.monitor.id()) +
               " signals=" + SignalNames(outcome.held);
      });
    }
    return;
  }
  log_.Report(
      kRejectionIds[static_cast<std::size_t>(verdict.intake)],
      "sample_rejected", [&] {
        return (verdict.intake != Intake::kAccepted
                    ? "reason=" + std::string(IntakeName(verdict.intake))
                    : "reason=missing_signal signal=" +
                          SignalNames(outcome.missing)) +
               " valve=" + LogValue(valve.monitor.id()) +
               " seq=" + std::to_string(sample.seq);
      });
}

void Pipeline::Publish(const Valve& valve, const ValveOutcome& outcome) {
  const std::string& id = valve.monitor.id();
  std::string reason = "refused";
  try {
    if (decisions_.Publish(id, outcome.models, outcome.verdict)) {
      counters_.Add(Counter::kDecisions);
      return;
    }
  } catch (const DataError& error) {
    reason = error.what();
  }
  counters_.Add(Counter::kDecisionsUnsent);
  log_.Report(LogId::kUnsent, "publication_failed", [&] {
    return "topic=DecisionVector valve=" + LogValue(id) +
           " reason=" + LogValue(reason);
  });
}

void Pipeline::FlushDecisions() {
  if (const std::uint64_t unsent = decisions_.Flush(); unsent > 0) {
    counters_.Add(Counter::kDecisionsUnsent, unsent);
    log_.Report(LogId::kUnsent, "publication_failed", [unsent] {
      return "topic=DecisionBatch vectors=" + std::to_string(unsent);
    });
  }
}

void Pipeline::Poll(TimePoint now) {
  pulse_.Beat();
  AdoptNextResolver();
  FlushDecisions();
  if (decisions_.LastValuesDue()) {
    PublishLast();
  }
  // What visits every valve runs four times a second and not at each call, of
  // which there are ten a second or more.
  if (now - last_poll_ >= kPollPeriod) {
    last_poll_ = now;
    CheckSilentValves(now);
  }
  if (now - last_checkpoint_ >= options_.checkpoint_period) {
    last_checkpoint_ = now;
    TakeCheckpoint(false);
  }
}

void Pipeline::CheckSilentValves(TimePoint now) {
  const std::chrono::milliseconds stale_timeout(
      static_cast<std::int64_t>(options_.stale_timeout_s * 1e3));
  idle_.clear();
  for (const std::unique_ptr<Valve>& valve : valves_) {
    ValveMonitor& monitor = valve->monitor;
    if (IsEvictable(*valve) && monitor.Silence(now) >= options_.place_timeout) {
      idle_.push_back(valve.get());
    }
    // The order matters: CountStale() acts only on a valve that CheckStale()
    // has labelled, CheckTimeout() on such a one or if its stream has ended.
    if (monitor.CheckStale(now, journal_)) {
      counters_.Add(Counter::kStaleEvents);
      log_.Report(LogId::kStale, "valve_stale",
                  [&monitor] { return "valve=" + LogValue(monitor.id()); });
      Tell([&](ValveListener& each) {
        each.OnSilence(monitor.id(), Silence::kStale);
      });
    }
    counters_.Add(Quality::kStale, monitor.CountStale(now));
    monitor.CheckTimeout(now, stale_timeout, journal_);
  }
  if (recovery_deadline_ && now >= *recovery_deadline_) {
    recovery_deadline_.reset();
    ExpireRecovery();
  }
  ForgetEnded(now, stale_timeout);
  TakeCheckpoint(true);
  UpdateCensus(now);
}

// Gives back the memory of unknown valves whose publishers ended their streams
// and did not come back. A valve that merely fell silent stays: it may be one
// that is there and is not heard.
void Pipeline::ForgetEnded(TimePoint now, std::chrono::milliseconds age) {
  std::vector<Valve*> gone;
  for (const std::unique_ptr<Valve>& valve : valves_) {
    if (IsEvictable(*valve) && valve->monitor.EndedSince(now) > age) {
      gone.push_back(valve.get());
    }
  }
  for (Valve* const valve : gone) {
    Evict(*valve);
  }
  if (!gone.empty()) {
    malloc_trim(0);  // The library keeps what is freed in small pieces.
  }
}

void Pipeline::ExpireRecovery() {
  const std::int64_t now_ns = context_.utc_now_ns();
  for (const std::unique_ptr<Valve>& valve : valves_) {
    valve->monitor.ExpireRecovery(now_ns, journal_);
  }
  for (auto& [id, tracker] : recovered_) {
    tracker.ExpireRecovery(now_ns, journal_);
  }
}

void Pipeline::UpdateCensus(TimePoint now) {
  ValveCensus census;
  for (const std::unique_ptr<Valve>& valve : valves_) {
    const ValveMonitor& monitor = valve->monitor;
    ++census.valves;
    census.unassigned += monitor.models() == nullptr ? 1 : 0;
    census.stale += monitor.stale() ? 1 : 0;
    census.ended += monitor.ended() ? 1 : 0;
    census.open_episodes += monitor.episode_open() ? 1 : 0;
    census.trace_bytes += monitor.trace_bytes();
    CountUnjudged(monitor, census);
    if (monitor.Contested(now) && census.contested++ == 0) {
      census.contested_valve = monitor.id();
    }
  }
  if (census.contested > 0) {
    log_.Report(
        LogId::kTwoPublishers, "two_publishers",
        [&census] {
          return "valves=" + std::to_string(census.contested) +
                 " first=" + LogValue(census.contested_valve);
        },
        LogLevel::kError);
  }
  // Counted without the lock: readers wait for the copy, not for all valves.
  const MutexLock lock(mutex_);
  census_ = census;
}

void Pipeline::PublishLast() {
  for (const std::unique_ptr<Valve>& valve : valves_) {
    const ValveMonitor& monitor = valve->monitor;
    // A zero stamp: a model set was adopted after the last sample.
    if (monitor.seen() && !monitor.closed() &&
        CountsAsTime(monitor.verdict()) && monitor.verdict().stamp_ns != 0) {
      Guarded(counters_, log_, "last_decision", [&] {
        decisions_.PublishLast(monitor.id(), monitor.models(),
                               monitor.verdict());
      });
    }
  }
}

// @param urgent only what is running out of rows.
void Pipeline::TakeCheckpoint(bool urgent) {
  Checkpoint checkpoint;
  for (const std::unique_ptr<Valve>& valve : valves_) {
    if (!urgent || IsFilling(valve->monitor.book_rows())) {
      valve->monitor.TakeCheckpoint(checkpoint);
    }
  }
  Tell([&](ValveListener& each) { each.TakeCheckpoint(checkpoint, urgent); });
  if (!checkpoint.empty()) {
    journal_.Commit(std::move(checkpoint));
  }
}

void Pipeline::Reassign(std::shared_ptr<const ModelResolver> resolver) {
  const MutexLock lock(mutex_);
  next_resolver_ = std::move(resolver);
}

void Pipeline::AdoptNextResolver() {
  {
    const MutexLock lock(mutex_);
    if (!next_resolver_) {
      return;
    }
    resolver_ = std::exchange(next_resolver_, nullptr);
  }
  // A slot stays reserved for what is assigned now or was left open.
  std::erase_if(reserved_, [this](const std::string& id) {
    const auto known = recovered_.find(id);
    return (known == recovered_.end() ||
            known->second.recovering() == nullptr) &&
           !accumulators_.contains(id);
  });
  for (const std::string& id : resolver_->AssignedValves()) {
    Reserve(id);
  }
  std::uint64_t swapped = 0;
  // plans_ has weak pointers only, and valves with the same set share a plan.
  std::vector<EngineParts> alive;  // Keeps each plan alive, adopted or not.
  for (const std::unique_ptr<Valve>& valve : valves_) {
    ValveMonitor& monitor = valve->monitor;
    std::optional<EngineParts> parts;
    // A valve whose new set cannot be loaded keeps its old one.
    if (Resolve(monitor.id(), parts) && monitor.Adopt(parts, journal_)) {
      ++swapped;
    }
    if (parts) {
      alive.push_back(*parts);
    }
    monitor.HoldIsolation(resolver_->IsolationHeld(monitor.id()));
  }
  counters_.Add(Counter::kModelSwaps, swapped);
  log_.Line(LogLevel::kInfo,
            "models_reassigned valves_swapped=" + std::to_string(swapped));
}

ValveCensus Pipeline::census() const {
  const MutexLock lock(mutex_);
  return census_;
}

std::vector<std::string> Pipeline::valve_names() const {
  const MutexLock lock(mutex_);
  return names_;
}

}  // namespace fdi::monitor
