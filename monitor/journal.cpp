#include "monitor/journal.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "base/printable.h"

namespace fdi::monitor {
namespace {

// Bounds the time of a commit, and so how long later events wait for it.
constexpr std::size_t kRecordsPerCommit = 1'000;

// Few large transactions, because each one repacks the newest chunk of a trace.
constexpr std::size_t kPointsPerCommit = 5'000;
// Number of open episodes extended per commit; each takes half a millisecond.
constexpr int kTracesPerCommit = 100;

// Stop() waits this long for the subscribers' acknowledgements of the last
// events. Unacknowledged ones are published again by the next session.
constexpr std::chrono::milliseconds kLastDelivery{300};

}  // namespace

Journal::Journal(HistorySink& history, EventSink& bus,
                 const MonitorContext& context, const JournalOptions& options)
    : history_(history),
      bus_(bus),
      context_(context),
      counters_(context.counters),
      log_(context.log),
      options_(options) {}

Journal::~Journal() {
  try {
    Stop();
  } catch (...) {
    // The error is reported only to those who call Stop() themselves.
  }
}

void Journal::Start() {
  last_commit_ = Clock::now();
  writer_.Start([this] { Write(); });
  publisher_.Start([this] { PublishAll(); });
}

void Journal::Stop() {
  if (!writer_.started()) {
    return;
  }
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    stop_by_ = Clock::now() + options_.stop_limit;
    work_.notify_one();
  }
  // The publisher ends after the writer, whose last commits it awaits; then
  // this thread marks what was published last.
  FirstError errors;
  errors.Try([this] { writer_.Join(); });
  {
    const MutexLock lock(mutex_);
    publishing_ends_ = true;
    unsent_changed_.notify_one();
  }
  errors.Try([this] { publisher_.Join(); });
  // From here on only this thread uses the queues and the history. Records it
  // cannot write are not tried again; the events among them count as lost.
  options_.tries = 1;
  {
    const MutexLock lock(mutex_);
    for (Deferred& each : std::exchange(deferred_, {})) {
      records_.push_back(std::move(each.record));
    }
  }
  MarkDelivered(Clock::now(), kLastDelivery);
  WriteRecords();
  {
    const MutexLock lock(mutex_);
    for (const Record& record : std::exchange(records_, {})) {
      if (std::holds_alternative<PendingEvent>(record)) {
        counters_.Add(Counter::kEventsLost);
      }
    }
  }
  CommitBuffered();
  errors.Rethrow();
}

// The path of an event. One Pending is in two queues, because the two threads
// advance independently; its stage connects them:
//
//     unsent_       until the publisher takes it: at its stage kCommitted or
//                   kFailed, or at its deadline
//     records_      until the history thread has committed it
//     undelivered_  published, until acknowledged and old enough
//     records_      as Sent, until the history has marked it
//
// If the commit comes after the deadline, the event is on the bus as not
// persisted and in the history all the same. If the mark is lost, the next
// session publishes the event once more, and subscribers drop the repeat.
void Journal::OnEvent(FaultEvent event) {
  if (event.transition.kind == TransitionKind::kDetected) {
    counters_.Add(Counter::kEpisodes);
  }
  auto pending = std::make_shared<Pending>();
  pending->event = std::move(event);
  pending->deadline = Clock::now() + options_.patience;
  const MutexLock lock(mutex_);
  // The bus does not take events as fast as they come. Those committed and not
  // published are left to the next session.
  if (unsent_.size() < options_.max_records) {
    unsent_.push_back(pending);
    unsent_changed_.notify_one();
  } else {
    counters_.Add(Counter::kEventsUnsent);
    log_.Report(LogId::kUnsent, "publication_failed", [] {
      return std::string("topic=FaultEvent reason=queue_full");
    });
  }
  const bool kept = AddLocked(pending);
  if (!kept) {
    counters_.Add(Counter::kEventsLost);
  }
  // A history that fails would only delay the event until its deadline.
  if (!kept || degraded_) {
    SetStageLocked(*pending, false);
  }
}

void Journal::MarkPublished(const FaultEvent& event) {
  auto pending = std::make_shared<Pending>();
  pending->event = event;
  pending->published = Clock::now();
  const MutexLock lock(mutex_);
  undelivered_.push_back(std::move(pending));
}

void Journal::OnEvidence(EpisodeTrace trace) {
  const MutexLock lock(mutex_);
  // Points are bounded rather than traces, because memory grows with points.
  const std::size_t points = trace.trace.size();
  if (trace_points_ + points > options_.max_trace_points) {
    counters_.Add(Counter::kTraceDropped, points);
    return;
  }
  trace_points_ += points;
  traces_.push_back(std::move(trace));
  work_.notify_one();
}

void Journal::OnLook(EpisodeLook look) {
  const MutexLock lock(mutex_);
  AddLocked(std::move(look));
}

void Journal::OnStrength(StrengthPoint point) {
  const MutexLock lock(mutex_);
  AddLocked(point);
}

void Journal::OnNormal(const std::string& valve_id, std::int64_t stamp_ns) {
  const MutexLock lock(mutex_);
  AddLocked(Normal{valve_id, stamp_ns});
}

void Journal::OnSilence(const std::string& valve_id,
                        std::optional<std::int64_t> since_ns) {
  const MutexLock lock(mutex_);
  AddLocked(Silent{valve_id, since_ns});
}

void Journal::OnGap(DataGap gap) {
  counters_.Add(Counter::kGaps);
  log_.Report(
      LogId::kGap, "data_gap",
      [&gap] {
        return "valve=" + LogValue(gap.valve_id) + " reason=" + gap.reason;
      },
      LogLevel::kInfo);
  const MutexLock lock(mutex_);
  AddLocked(std::move(gap));
}

void Journal::OnResumed(const OpenEpisode& episode, std::int64_t stamp_ns) {
  log_.Line(LogLevel::kInfo,
            "episode_resumed valve=" + LogValue(episode.valve_id));
  const MutexLock lock(mutex_);
  AddLocked(Resumption{episode.episode_id, stamp_ns, episode.valve_id});
}

void Journal::Commit(Checkpoint checkpoint) {
  const MutexLock lock(mutex_);
  checkpoint_ = Merged(std::move(checkpoint_), std::move(checkpoint));
  work_.notify_one();
}

bool Journal::AddLocked(Record record) {
  if (records_.size() >= options_.max_records) {
    log_.Report(
        LogId::kHistoryLost, "history_dropped",
        [this]() REQUIRES(mutex_) {
          return "waiting=" + std::to_string(records_.size());
        },
        LogLevel::kError);
    return false;
  }
  records_.push_back(std::move(record));
  work_.notify_one();
  return true;
}

void Journal::SetStageLocked(Pending& pending, bool committed) {
  pending.stage =
      committed ? Pending::Stage::kCommitted : Pending::Stage::kFailed;
  unsent_changed_.notify_one();
}

Journal::Backlog Journal::backlog() const {
  const MutexLock lock(mutex_);
  return {records_.size(), trace_points_};
}

void Journal::Write() {
  const auto has_work = [this]() REQUIRES(mutex_) {
    return stopping_ || !records_.empty() || !checkpoint_.empty() ||
           trace_points_ >= kPointsPerCommit;
  };
  while (true) {
    bool last_attempt = false;
    {
      MutexLock lock(mutex_);
      // Not has_work: what could not be written is still queued, so the thread
      // would retry without a pause.
      if (degraded_) {
        work_.wait_for(lock, options_.retry_period,
                       [this]() REQUIRES(mutex_) { return stopping_; });
      } else {
        work_.wait_for(lock, options_.commit_period, has_work);
      }
      last_attempt = stopping_;
    }
    // While the history is degraded, a successful commit shows that it has
    // recovered.
    const bool served = (!degraded_ || CommitBuffered()) && WriteWaiting();
    if (!served) {
      FailWaitingEvents();
    } else if (degraded_) {
      Recovered();
    }
    const MutexLock lock(mutex_);
    const bool idle =
        records_.empty() && traces_.empty() && checkpoint_.empty();
    // An attempt that failed before Stop() is not the last one: the history may
    // have recovered since.
    if ((stopping_ && idle) || (last_attempt && !served)) {
      return;
    }
  }
}

// Commits the queued records, events before evidence.
// @returns false once the history fails.
bool Journal::WriteWaiting() {
  while (true) {
    if (!RetryDeferred() || !WriteRecords() || !WriteCheckpoint()) {
      return false;
    }
    {
      const MutexLock lock(mutex_);
      // A commit is due even without evidence: it stores gaps and marks, which
      // are only buffered, and the sign of life from which the next session
      // dates a crash.
      const bool due = Clock::now() - last_commit_ >= options_.commit_period;
      const bool wanted = (stopping_ || degraded_) && !traces_.empty();
      if (!due && !wanted && trace_points_ < kPointsPerCommit) {
        return true;
      }
    }
    if (!WriteTraces()) {
      return false;
    }
  }
}

bool Journal::WriteRecords() {
  std::vector<const Record*> batch;
  while (true) {
    {
      const MutexLock lock(mutex_);
      // A deque: pointers stay valid, as only this thread takes from the front.
      const std::size_t count = std::min(records_.size(), kRecordsPerCommit);
      batch.clear();
      for (std::size_t i = 0; i < count; ++i) {
        batch.push_back(&records_[i]);
      }
    }
    if (batch.empty()) {
      return true;
    }
    if (!WriteBatch(batch)) {
      return false;
    }
    const MutexLock lock(mutex_);
    records_.erase(
        records_.begin(),
        records_.begin() + static_cast<std::ptrdiff_t>(batch.size()));
  }
}

void Journal::ReportRefused(const FaultEvent& event) {
  counters_.Add(Counter::kEventsRefused);
  log_.Report(LogId::kRefused, "event_refused", [&event] {
    return "valve=" + LogValue(event.valve_id) +
           " transition=" + std::string(TransitionName(event.transition.kind));
  });
}

// Commits events, resumptions, looks and strengths together; gaps and marks are
// buffered only after that succeeded, so that a retry does not buffer them
// twice. A record that fails for its own sake leaves the batch.
// @param failures of the records so far. @returns false once the history fails.
bool Journal::WriteBatch(std::vector<const Record*> batch, int failures) {
  const Record* at = nullptr;
  std::vector<std::pair<const Record*, std::string>> failed;
  std::vector<const Record*> refused;
  const auto commit_the_others = [&] {
    refused.clear();
    try {
      history_.CommitBatch([&] {
        for (const Record* record : batch) {
          at = record;
          if (!Store(*record)) {
            refused.push_back(record);
          }
        }
        at = nullptr;
      });
      return true;
    } catch (const RecordError& error) {
      if (at == nullptr) {
        throw;  // From a buffered record.
      }
      failed.emplace_back(at, error.what());
      std::erase(batch, std::exchange(at, nullptr));
      return false;
    }
  };
  const bool any = std::ranges::any_of(batch, [](const Record* record) {
    return !std::holds_alternative<DataGap>(*record) &&
           !std::holds_alternative<Sent>(*record);
  });
  const bool committed = !any || Attempt([&] {
    while (!commit_the_others()) {
    }
  });
  const auto set_stages = [this](const std::vector<const Record*>& records,
                                 bool stored) {
    const MutexLock lock(mutex_);
    for (const Record* record : records) {
      if (const auto* event = std::get_if<PendingEvent>(record)) {
        SetStageLocked(**event, stored);
      }
    }
  };
  std::vector<const Record*> unstored = refused;
  for (const auto& [record, reason] : failed) {
    unstored.push_back(record);
  }
  set_stages(unstored, false);
  if (!committed) {
    set_stages(batch, false);
    return false;
  }
  for (const Record* record : refused) {
    ReportRefused(std::get<PendingEvent>(*record)->event);
    std::erase(batch, record);
  }
  set_stages(batch, true);
  for (const auto& [record, reason] : failed) {
    if (failures + 1 >= options_.tries) {
      SetAside(*record, reason);
    } else {
      deferred_.push_back({*record, failures + 1});
      retry_deferred_at_ = Clock::now() + options_.retry_period;
    }
  }
  return Buffer(batch);
}

// Gaps and marks.
bool Journal::Buffer(const std::vector<const Record*>& batch) {
  return Attempt([&] {
    for (const Record* record : batch) {
      if (const auto* gap = std::get_if<DataGap>(record)) {
        history_.AddGap(*gap);
      } else if (const auto* sent = std::get_if<Sent>(record)) {
        history_.MarkSent(sent->pending->event);
      }
    }
  });
}

// @returns false if the history refuses it.
bool Journal::Store(const Record& record) {
  if (const auto* event = std::get_if<PendingEvent>(&record)) {
    return history_.Record((*event)->event);
  }
  if (const auto* resumed = std::get_if<Resumption>(&record)) {
    history_.Resume(resumed->episode_id, resumed->stamp_ns);
    history_.StoreSilence(resumed->valve_id, std::nullopt);
  } else if (const auto* look = std::get_if<EpisodeLook>(&record)) {
    history_.StoreLook(*look);
  } else if (const auto* point = std::get_if<StrengthPoint>(&record)) {
    history_.StoreStrength(*point);
  } else if (const auto* normal = std::get_if<Normal>(&record)) {
    history_.ConfirmNormal(normal->valve_id, normal->stamp_ns);
  } else if (const auto* silent = std::get_if<Silent>(&record)) {
    history_.StoreSilence(silent->valve_id, silent->since_ns);
  }
  return true;
}

// Tries again, each by itself, what failed for its own sake.
// @returns false once the history fails.
bool Journal::RetryDeferred() {
  if (Clock::now() < retry_deferred_at_) {
    return true;
  }
  bool served = true;
  for (Deferred& each : std::exchange(deferred_, {})) {
    served = served && WriteBatch({&each.record}, each.failures);
    if (!served) {
      deferred_.push_back(std::move(each));
    }
  }
  return served;
}

// A record is given up. Evidence, looks and strengths do not know their valve.
void Journal::SetAside(const Record& record, const std::string& reason) {
  const std::int64_t now_ns = context_.utc_now_ns();
  DataGap where{"", now_ns, now_ns, "record_set_aside"};
  std::string_view what = "evidence";
  if (const auto* event = std::get_if<PendingEvent>(&record)) {
    counters_.Add(Counter::kEventsLost);
    what = TransitionName((*event)->event.transition.kind);
    where.valve_id = (*event)->event.valve_id;
    where.from_ns = where.to_ns = (*event)->event.transition.stamp_ns;
  } else if (const auto* resumed = std::get_if<Resumption>(&record)) {
    what = "RESUMED";
    where.valve_id = resumed->valve_id;
    where.from_ns = where.to_ns = resumed->stamp_ns;
  } else if (const auto* normal = std::get_if<Normal>(&record)) {
    what = "normal";
    where.valve_id = normal->valve_id;
    where.from_ns = where.to_ns = normal->stamp_ns;
  }
  counters_.Add(Counter::kRecordsSetAside);
  log_.Report(
      LogId::kSetAside, "record_set_aside",
      [&] {
        return "record=" + std::string(what) +
               " valve=" + LogValue(where.valve_id) +
               " reason=" + LogValue(reason);
      },
      LogLevel::kError);
  OnGap(std::move(where));
}

// A checkpoint that fails is merged into the next one.
// It is taken out of the queue before the commit, because committing it twice
// would count its time twice: the sink guarantees all or nothing.
bool Journal::WriteCheckpoint() {
  Checkpoint checkpoint;
  {
    const MutexLock lock(mutex_);
    checkpoint = std::exchange(checkpoint_, {});
  }
  if (checkpoint.empty() ||
      AttemptOrDrop([&] { history_.CommitCheckpoint(checkpoint); },
                    checkpoint_failures_, [&] { checkpoint = {}; })) {
    return true;
  }
  const MutexLock lock(mutex_);
  // The failed one is the older one, and the newer one of two accumulators of a
  // valve is kept.
  checkpoint_ = Merged(std::move(checkpoint), std::move(checkpoint_));
  return false;
}

// Buffers evidence and commits it immediately, so that no event waits for it.
// An event that arrives meanwhile is committed with the evidence buffered so
// far.
bool Journal::WriteTraces() {
  last_commit_ = Clock::now();
  std::size_t points = 0;
  for (int n = 0; n < kTracesPerCommit && points < kPointsPerCommit; ++n) {
    std::optional<EpisodeTrace> trace;
    bool late = false;
    {
      const MutexLock lock(mutex_);
      if (traces_.empty()) {
        break;
      }
      trace = std::move(traces_.front());
      traces_.pop_front();
      trace_points_ -= trace->trace.size();
      late = stopping_ && Clock::now() > stop_by_;
    }
    points += trace->trace.size();
    if (late || !Attempt([&] { history_.AddTrace(*trace); })) {
      counters_.Add(Counter::kTraceDropped, trace->trace.size());
    }
    // The commit of a batch includes what is buffered. Without this check an
    // event would wait until up to kTracesPerCommit traces are packed.
    if (HasQueuedEvent()) {
      return WriteRecords();
    }
  }
  return CommitBuffered();
}

bool Journal::HasQueuedEvent() const {
  const MutexLock lock(mutex_);
  return std::ranges::any_of(records_, [](const Record& record) {
    return std::holds_alternative<PendingEvent>(record);
  });
}

bool Journal::CommitBuffered() {
  return AttemptOrDrop([this] { history_.Commit(); }, buffered_failures_,
                       [this] { history_.DropBuffered(); });
}

// As Attempt(), for what is buffered and for checkpoints: what fails for its
// own sake too often is dropped, so that the next attempt can succeed.
bool Journal::AttemptOrDrop(const std::function<void()>& call, int& failures,
                            const std::function<void()>& drop) {
  std::optional<std::string> reason;
  const bool done = Attempt([&] {
    try {
      call();
    } catch (const RecordError& error) {
      reason = error.what();
      throw;
    }
  });
  failures = reason ? failures + 1 : 0;
  if (failures >= options_.tries) {
    failures = 0;
    drop();
    SetAside(EpisodeLook{}, *reason);
  }
  return done;
}

bool Journal::Attempt(const std::function<void()>& call) {
  pulse_.Beat();
  try {
    call();
    return true;
  } catch (const std::exception& error) {
    counters_.Add(Counter::kPersistFailures);
    if (!degraded_.exchange(true)) {
      degraded_since_ns_ = context_.utc_now_ns();
    }
    const std::string reason = error.what();
    log_.Report(
        LogId::kPersistence, "persistence_degraded",
        [&reason] { return "reason=" + LogValue(reason); }, LogLevel::kError);
    return false;
  }
}

// After one event has failed, those queued behind it need not wait for their
// deadlines.
void Journal::FailWaitingEvents() {
  const MutexLock lock(mutex_);
  for (const Record& record : records_) {
    if (const auto* event = std::get_if<PendingEvent>(&record)) {
      SetStageLocked(**event, false);
    }
  }
}

void Journal::Recovered() {
  degraded_ = false;
  log_.Line(LogLevel::kInfo, "persistence_recovered");
  const std::int64_t now_ns = context_.utc_now_ns();
  // The clock may have been set back since.
  OnGap({"", std::min(degraded_since_ns_, now_ns), now_ns,
         "persistence_degraded"});
}

// Waits for the oldest unsent event only, which keeps the order. Each deadline
// runs from the arrival of its event, so the delays do not add up.
void Journal::PublishAll() {
  MutexLock lock(mutex_);
  while (true) {
    const bool awake = unsent_changed_.wait_for(
        lock, options_.commit_period, [this]() REQUIRES(mutex_) {
          return publishing_ends_ || !unsent_.empty();
        });
    lock.unlock();
    MarkDelivered(Clock::now() - options_.delivery_time, {});
    lock.lock();
    if (unsent_.empty()) {
      if (awake) {
        return;
      }
      continue;
    }
    const PendingEvent next = unsent_.front();
    unsent_changed_.wait_until(
        lock, next->deadline, [this, &next]() REQUIRES(mutex_) {
          return publishing_ends_ || next->stage != Pending::Stage::kWaiting;
        });
    const bool persisted = next->stage == Pending::Stage::kCommitted;
    unsent_.pop_front();
    lock.unlock();
    Publish(next, persisted);
    lock.lock();
  }
}

// Marks events published before `limit` as sent if all are acknowledged, and
// the oldest ones beyond max_undelivered in any case.
void Journal::MarkDelivered(Clock::time_point limit,
                            std::chrono::milliseconds patience) {
  const auto due = [&]() REQUIRES(mutex_) {
    return !undelivered_.empty() && undelivered_.front()->published <= limit;
  };
  MutexLock lock(mutex_);
  bool acknowledged = due();
  lock.unlock();
  // Without the lock, because it may wait for subscribers. Events published
  // meanwhile are newer than `limit` and therefore not marked.
  acknowledged = acknowledged && options_.acknowledged(patience);
  lock.lock();
  while (undelivered_.size() > options_.max_undelivered ||
         (acknowledged && due())) {
    AddLocked(Sent{std::move(undelivered_.front())});
    undelivered_.pop_front();
  }
}

void Journal::Publish(const PendingEvent& pending, bool persisted) {
  const FaultEvent& event = pending->event;
  const bool sent = bus_.Publish(event, persisted);
  const auto fields = [&] {
    return "valve=" + LogValue(event.valve_id) +
           " transition=" + std::string(TransitionName(event.transition.kind));
  };
  if (!persisted) {
    counters_.Add(Counter::kEventsUnpersisted);
    log_.Report(LogId::kUnpersisted, "event_unpersisted", fields);
  }
  if (sent) {
    counters_.Add(Counter::kEvents);
    const MutexLock lock(mutex_);
    pending->published = Clock::now();
    undelivered_.push_back(pending);
  } else {
    counters_.Add(Counter::kEventsUnsent);
    log_.Report(LogId::kUnsent, "publication_failed",
                [&] { return "topic=FaultEvent " + fields(); });
  }
}

}  // namespace fdi::monitor
