// What the thread of EpisodeWriter hands to the history.
#include <algorithm>
#include <optional>
#include <utility>

#include "monitor/episode_writer.h"

namespace fdi::monitor {
namespace {

// Bounds how long a commit takes, and so how long later events wait for it.
constexpr std::size_t kRecordsPerCommit = 1'000;

}  // namespace

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

}  // namespace fdi::monitor
