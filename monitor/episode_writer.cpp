#include "monitor/episode_writer.h"

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <utility>

namespace fdi::monitor {
namespace {

// Few and large transactions: the newest chunk of a trace is packed anew in
// each of them.
constexpr std::size_t kPointsPerCommit = 5'000;

// Bounds how long a commit takes, and so how long later events wait for it.
constexpr std::size_t kRecordsPerCommit = 1'000;

}  // namespace

EpisodeWriter::EpisodeWriter(HistorySink& history, EventSink& bus,
                             Counters& counters, ThrottledLog& log,
                             EpisodeWriterOptions options)
    : history_(history),
      counters_(counters),
      log_(log),
      options_(std::move(options)),
      last_commit_(std::chrono::steady_clock::now()),
      outbox_(bus, counters, log, options_.patience,
              [this](const EpisodeEvent& event) { Enqueue(Sent{event}); }),
      thread_([this] { Run(); }) {}

EpisodeWriter::~EpisodeWriter() {
  Stop();
}

void EpisodeWriter::Event(EpisodeEvent event) {
  if (event.transition.kind == TransitionKind::kDetected) {
    counters_.Add(Counter::kEpisodes);
  }
  const std::shared_ptr<PendingEvent> pending = outbox_.Add(std::move(event));
  if (!Enqueue(pending)) {
    counters_.Add(Counter::kEventsLost);
    outbox_.Settle(*pending, false);
  } else if (degraded_) {
    outbox_.Settle(*pending, false);
  }
}

void EpisodeWriter::Evidence(EpisodeTrace trace) {
  const std::lock_guard lock(mutex_);
  const std::size_t points = trace.trace.size();
  if (trace_points_ + points > options_.max_trace_points) {
    counters_.Add(Counter::kTraceDropped, points);
    return;
  }
  trace_points_ += points;
  traces_.push_back(std::move(trace));
  changed_.notify_one();
}

void EpisodeWriter::Gap(DataGap gap) {
  counters_.Add(Counter::kGaps);
  log_.Report(
      LogId::kGap, "data_gap",
      [&gap] { return "valve=" + gap.valve_id + " reason=" + gap.reason; },
      LogLevel::kInfo);
  Enqueue(std::move(gap));
}

void EpisodeWriter::Resumed(const OpenEpisode& episode, std::int64_t stamp_ns) {
  log_.Line(LogLevel::kInfo, "episode_resumed valve=" + episode.valve_id);
  Enqueue(Resumption{episode.episode_id, stamp_ns});
}

void EpisodeWriter::Keep(Checkpoint checkpoint) {
  const std::lock_guard lock(mutex_);
  checkpoint_ = Merged(std::move(checkpoint_), std::move(checkpoint));
  changed_.notify_one();
}

bool EpisodeWriter::Enqueue(Record record) {
  const std::lock_guard lock(mutex_);
  if (records_.size() >= options_.max_records) {
    log_.Report(
        LogId::kHistoryLost, "history_dropped",
        [this] { return "waiting=" + std::to_string(records_.size()); },
        LogLevel::kError);
    return false;
  }
  records_.push_back(std::move(record));
  changed_.notify_one();
  return true;
}

EpisodeWriter::Backlog EpisodeWriter::backlog() const {
  const std::lock_guard lock(mutex_);
  return {records_.size(), trace_points_};
}

void EpisodeWriter::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    stop_by_ = std::chrono::steady_clock::now() + options_.stop_limit;
    changed_.notify_one();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
  outbox_.Stop();
  // What the outbox published last is still to be marked.
  WriteRecords();
  for (const Record& record : records_) {
    if (std::holds_alternative<std::shared_ptr<PendingEvent>>(record)) {
      counters_.Add(Counter::kEventsLost);
    }
  }
  records_.clear();
  Commit();
}

void EpisodeWriter::Run() {
  const auto has_work = [this] {
    return stopping_ || !records_.empty() || !checkpoint_.empty() ||
           trace_points_ >= kPointsPerCommit;
  };
  while (true) {
    {
      std::unique_lock lock(mutex_);
      if (degraded_) {
        changed_.wait_for(lock, options_.retry_period,
                          [this] { return stopping_; });
      } else {
        changed_.wait_for(lock, options_.commit_period, has_work);
      }
    }
    const bool served = Serve();
    const std::lock_guard lock(mutex_);
    const bool idle =
        records_.empty() && traces_.empty() && checkpoint_.empty();
    if (stopping_ && (idle || !served)) {
      return;
    }
  }
}

// @returns false once the history fails.
bool EpisodeWriter::Serve() {
  if ((degraded_ && !Commit()) || !WriteWaiting()) {
    FailWaitingEvents();
    return false;
  }
  if (degraded_) {
    Recovered();
  }
  return true;
}

// Stores what waits, the evidence in its turn.
bool EpisodeWriter::WriteWaiting() {
  while (true) {
    if (!WriteRecords() || !WriteCheckpoint()) {
      return false;
    }
    {
      const std::lock_guard lock(mutex_);
      const bool due = std::chrono::steady_clock::now() - last_commit_ >=
                       options_.commit_period;
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

bool EpisodeWriter::WriteRecords() {
  std::vector<const Record*> batch;
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      // Pointers stay: only this thread takes from the front.
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
    const std::lock_guard lock(mutex_);
    records_.erase(
        records_.begin(),
        records_.begin() + static_cast<std::ptrdiff_t>(batch.size()));
  }
}

// Events and resumptions in one commit; gaps and marks are buffered once that
// succeeded, so that a repetition buffers nothing twice.
bool EpisodeWriter::WriteBatch(const std::vector<const Record*>& batch) {
  const auto stored_on_disk = [](const Record* record) {
    return std::holds_alternative<std::shared_ptr<PendingEvent>>(*record) ||
           std::holds_alternative<Resumption>(*record);
  };
  const bool any = std::any_of(batch.begin(), batch.end(), stored_on_disk);
  const bool stored = !any || Attempt([&] {
    history_.Together([&] {
      for (const Record* record : batch) {
        WriteStep(*record);
      }
    });
  });
  for (const Record* record : batch) {
    if (const auto* event =
            std::get_if<std::shared_ptr<PendingEvent>>(record)) {
      outbox_.Settle(**event, stored);
    }
  }
  return stored && Attempt([&] {
           for (const Record* record : batch) {
             Buffer(*record);
           }
         });
}

// One that fails waits for the next, which is laid on top of it.
bool EpisodeWriter::WriteCheckpoint() {
  Checkpoint checkpoint;
  {
    const std::lock_guard lock(mutex_);
    checkpoint = std::exchange(checkpoint_, {});
  }
  if (checkpoint.empty() || Attempt([&] { history_.Keep(checkpoint); })) {
    return true;
  }
  const std::lock_guard lock(mutex_);
  checkpoint_ = Merged(std::move(checkpoint), std::move(checkpoint_));
  return false;
}

// Buffers evidence and commits it at once, so that no event waits for it.
bool EpisodeWriter::WriteTraces() {
  last_commit_ = std::chrono::steady_clock::now();
  std::size_t points = 0;
  while (points < kPointsPerCommit) {
    std::optional<EpisodeTrace> trace;
    bool late = false;
    {
      const std::lock_guard lock(mutex_);
      if (traces_.empty()) {
        break;
      }
      trace = std::move(traces_.front());
      traces_.pop_front();
      trace_points_ -= trace->trace.size();
      late = stopping_ && std::chrono::steady_clock::now() > stop_by_;
    }
    points += trace->trace.size();
    if (late || !Attempt([&] { history_.AddTrace(*trace); })) {
      counters_.Add(Counter::kTraceDropped, trace->trace.size());
    }
  }
  return Commit();
}

void EpisodeWriter::WriteStep(const Record& record) {
  if (const auto* event = std::get_if<std::shared_ptr<PendingEvent>>(&record)) {
    history_.Record((*event)->event);
  } else if (const auto* resumption = std::get_if<Resumption>(&record)) {
    history_.Resume(resumption->episode_id, resumption->stamp_ns);
  }
}

void EpisodeWriter::Buffer(const Record& record) {
  if (const auto* gap = std::get_if<DataGap>(&record)) {
    history_.AddGap(*gap);
  } else if (const auto* sent = std::get_if<Sent>(&record)) {
    history_.MarkSent(sent->event);
  }
}

bool EpisodeWriter::Attempt(const std::function<void()>& call) {
  pulse_.Beat();
  try {
    call();
    return true;
  } catch (const std::exception& error) {
    counters_.Add(Counter::kPersistFailures);
    if (!degraded_.exchange(true)) {
      degraded_since_ns_ = options_.utc_now_ns();
    }
    const std::string reason = error.what();
    log_.Report(
        LogId::kPersistence, "persistence_degraded",
        [&reason] { return "reason=\"" + reason + "\""; }, LogLevel::kError);
    return false;
  }
}

// No event that waits behind a failed one needs to wait for its deadline.
void EpisodeWriter::FailWaitingEvents() {
  const std::lock_guard lock(mutex_);
  for (const Record& record : records_) {
    if (const auto* pending =
            std::get_if<std::shared_ptr<PendingEvent>>(&record)) {
      outbox_.Settle(**pending, false);
    }
  }
}

bool EpisodeWriter::Commit() {
  return Attempt([this] { history_.Commit(); });
}

void EpisodeWriter::Recovered() {
  degraded_ = false;
  log_.Line(LogLevel::kInfo, "persistence_recovered");
  Gap({"", degraded_since_ns_, options_.utc_now_ns(), "persistence_degraded"});
}

}  // namespace fdi::monitor
