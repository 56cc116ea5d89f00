#include "monitor/episode_writer.h"

#include <exception>
#include <optional>
#include <string>
#include <utility>

namespace fdi::monitor {

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
