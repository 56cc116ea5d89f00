#include "storage/runs/run_recorder.h"

#include <algorithm>
#include <utility>

#include <unistd.h>

#include "base/error.h"
#include "base/time_text.h"
#include "storage/runs/sql.h"

namespace fdi::storage {
namespace sql = runs_sql;
namespace {

// Marks the runs of crashed recorders as interrupted and compacts their tails.
void Recover(Database& database, const RecorderLiveness& liveness,
             std::size_t chunk_samples) {
  // Ids are collected before their rows are changed: SQLite does not define
  // what a query returns from a table that is modified meanwhile.
  std::vector<std::int64_t> dead;
  Statement recorders = database.Prepare("SELECT recorder_id FROM recorder");
  while (recorders.Step()) {
    if (!liveness.IsAlive(recorders.Int64(0))) {
      dead.push_back(recorders.Int64(0));
    }
  }
  Statement runs = database.Prepare(sql::runs_of_recorder);
  for (const std::int64_t recorder : dead) {
    std::vector<std::pair<std::int64_t, std::int64_t>> left;
    runs.Bind(recorder);
    while (runs.Step()) {
      left.emplace_back(runs.Int64(0), runs.Int64(1));
    }
    for (const auto& [run_id, samples] : left) {
      try {
        // The tail holds the last samples of a run.
        const std::vector<StoredSample> tail = TakeTail(database, run_id);
        InsertChunks(database, run_id,
                     samples - static_cast<std::int64_t>(tail.size()), tail,
                     chunk_samples);
      } catch (const DataError&) {
        // A damaged tail stays as it is: whoever reads the run is told.
      }
      SetState(database, run_id, RunState::kInterrupted);
    }
    database.Run(sql::delete_recorder, recorder);
  }
}

}  // namespace

RunRecorder::RunRecorder(const std::filesystem::path& path,
                         const RunRecorderOptions& options)
    : chunk_samples_(static_cast<std::size_t>(options.chunk_samples)),
      database_(path, RunsSchema(), Access::kWriter) {
  Require(options.chunk_samples >= 1 &&
              options.chunk_samples <= static_cast<int>(kMaxChunkSamples),
          "chunk_samples is in 1..65536");
  Announce();
}

void RunRecorder::Announce() {
  liveness_.emplace(database_.path());
  Transaction transaction(database_);
  Recover(database_, *liveness_, chunk_samples_);
  database_.Run(sql::insert_recorder, getpid(), NowNs());
  const std::int64_t id = database_.LastInsertRowid();
  // The id is locked before the commit makes it visible, so nobody takes this
  // recorder for dead. Ids are never given twice (AUTOINCREMENT), so a locked
  // byte stands for one recorder.
  liveness_->Claim(id);
  transaction.Commit();
  recorder_id_ = id;
}

bool RunRecorder::Refresh() {
  moved_ = database_.Refresh() || moved_;
  if (!moved_) {
    return false;
  }
  Announce();
  for (auto& [key, active] : runs_) {
    active.id = NewRunId();
    active.committed = {.threshold = chunk_samples_};
    active.hints = {};
    active.moved = active.pending.empty();
    if (!active.moved) {
      active.run.start_ns = active.pending.front().sample.stamp_ns;
    }
  }
  moved_ = false;
  return true;
}

RunRecorder::Key RunRecorder::Begin(const NewRun& run) {
  Require(run.period_s > 0.0, "the sample period is positive");
  const Key key = next_key_++;
  ActiveRun& active = runs_[key];
  active.id = NewRunId();
  active.run = run;
  // Staggered, so that many valves that start together do not fill their chunks
  // in the same commit. At least 1: a chunk is never empty.
  active.committed.threshold =
      (chunk_samples_ + 1) / 2 + key * 37 % (chunk_samples_ / 2 + 1);
  Touch(key, active);
  return key;
}

RunRecorder::ActiveRun& RunRecorder::Active(Key key) {
  const auto found = runs_.find(key);
  Require(found != runs_.end() && !found->second.end_asked,
          "a run that has ended takes no more samples");
  return found->second;
}

const std::string& RunRecorder::Id(Key key) const {
  const auto found = runs_.find(key);
  Require(found != runs_.end(), "RunRecorder::Id: the run has ended");
  return found->second.id;
}

void RunRecorder::SetPeriod(Key key, double period_s) {
  Require(period_s > 0.0, "the sample period is positive");
  ActiveRun& active = Active(key);
  active.run.period_s = period_s;
  Touch(key, active);
}

void RunRecorder::Append(Key key, const StoredSample& sample) {
  ActiveRun& active = Active(key);
  if (std::exchange(active.moved, false)) {
    active.run.start_ns = sample.sample.stamp_ns;
  }
  active.pending.push_back(sample);
  ++pending_;
  Touch(key, active);
}

void RunRecorder::Append(Key key, const LabelledSample& labelled) {
  StoredSample stored;
  stored.sample = labelled.sample;
  stored.truth = labelled.truth;
  Append(key, stored);
}

void RunRecorder::End(Key key) {
  if (const auto found = runs_.find(key); found != runs_.end()) {
    found->second.end_asked = true;
    Touch(key, found->second);
  }
}

void RunRecorder::Touch(Key key, ActiveRun& active) {
  // A run is listed once, however often it changes: a commit costs the number
  // of runs with something to store, not that of all.
  if (!std::exchange(active.dirty, true)) {
    dirty_.push_back(key);
  }
}

// The in-memory state of a run is updated only after the transaction has been
// committed: after an error everything is as before.
void RunRecorder::Commit() {
  if (dirty_.empty()) {
    return;
  }
  std::vector<Committed> after;
  after.reserve(dirty_.size());
  Transaction transaction(database_);
  for (const Key key : dirty_) {
    after.push_back(Store(runs_.at(key)));
  }
  transaction.Commit();
  for (std::size_t i = 0; i < dirty_.size(); ++i) {
    if (after[i].ended) {
      runs_.erase(dirty_[i]);
      continue;
    }
    ActiveRun& active = runs_.at(dirty_[i]);
    active.committed = after[i];
    active.dirty = false;
    active.pending.clear();
  }
  recorded_ += std::exchange(pending_, 0);
  dirty_.clear();
}

std::int64_t RunRecorder::DropPending() {
  // The runs stay dirty: rows and ends that a failed commit did not store are
  // still due.
  for (const Key key : dirty_) {
    runs_.at(key).pending.clear();
  }
  return std::exchange(pending_, 0);
}

void RunRecorder::Close() {
  for (auto& [key, active] : runs_) {
    active.end_asked = true;
    Touch(key, active);
  }
  // In the order of Begin(), which is then the order of the rows.
  std::sort(dirty_.begin(), dirty_.end());
  Commit();
  // The recorder's row goes last: if the commit above fails, the next recorder
  // finds the runs through it and marks them as interrupted.
  if (recorder_id_ != 0) {
    Transaction transaction(database_);
    database_.Run(sql::delete_recorder, recorder_id_);
    transaction.Commit();
    recorder_id_ = 0;
    database_.Checkpoint();
  }
}

// Writes the pending samples of a run. @returns its state after the commit.
RunRecorder::Committed RunRecorder::Store(ActiveRun& active) {
  Committed after = active.committed;
  if (active.moved) {  // Nothing of the run is in this file.
    after.ended = active.end_asked;
    return after;
  }
  if (after.run_id == 0) {
    after.run_id = InsertRun(database_, active.id, active.run, recorder_id_);
  } else if (after.period_s != active.run.period_s) {
    database_.Run(sql::set_period, active.run.period_s, after.run_id);
  }
  after.period_s = active.run.period_s;
  if (!active.pending.empty()) {
    RunCounters counters;
    for (const StoredSample& sample : active.pending) {
      counters.Count(sample);
    }
    AddCounters(database_, after.run_id, counters);
  }
  const std::size_t loose = after.tail + active.pending.size();
  if (loose >= after.threshold || (active.end_asked && loose > 0)) {
    Compact(active, after);
  } else if (!active.pending.empty()) {
    InsertTail(database_, after.run_id, after.samples, active.pending);
    after.tail = loose;
  }
  after.samples += static_cast<std::int64_t>(active.pending.size());
  if (active.end_asked && !after.ended) {
    SetState(database_, after.run_id, RunState::kComplete);
    after.ended = true;
  }
  return after;
}

// Converts tail and pending samples to chunks; an incomplete chunk remains a
// tail row.
void RunRecorder::Compact(ActiveRun& active, Committed& after) {
  std::vector<StoredSample> samples;
  if (after.tail > 0) {
    samples = TakeTail(database_, after.run_id);
  }
  std::int64_t first =
      after.samples - static_cast<std::int64_t>(samples.size());
  samples.insert(samples.end(), active.pending.begin(), active.pending.end());
  std::span<const StoredSample> rest = samples;
  while (rest.size() >= after.threshold ||
         (active.end_asked && !rest.empty())) {
    const auto part = rest.first(std::min(rest.size(), chunk_samples_));
    // After a commit that fails, the hints are ahead of the file. That is
    // harmless, as FindPredictor() uses them only if they fit.
    InsertChunk(database_, after.run_id, first, part, &active.hints);
    first += static_cast<std::int64_t>(part.size());
    rest = rest.subspan(part.size());
    // Only the first chunk is staggered.
    after.threshold = chunk_samples_;
  }
  if (!rest.empty()) {
    InsertTail(database_, after.run_id, first, rest);
  }
  after.tail = rest.size();
}

}  // namespace fdi::storage
