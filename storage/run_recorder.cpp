#include <algorithm>
#include <memory>
#include <utility>

#include <unistd.h>

#include "diagnosis/error.h"
#include "storage/recorder_liveness.h"
#include "storage/run_rows.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

/// A run of this recorder. `committed` is what the file holds.
struct ActiveRun {
  struct Committed {
    std::int64_t run_id{0};  // 0: no row yet
    std::int64_t samples{0};
    std::size_t tail{0};       // of them in the tail table
    std::size_t threshold{0};  // length of the tail that makes a chunk
    bool ended{false};
  };

  NewRun run;
  Committed committed;
  std::vector<StoredSample> pending;
  ChunkHints hints;
  bool end_asked{false};
  bool dirty{false};
};

/// Marks the runs of recorders that died, and compacts what they left.
void Recover(Database& database, RunRows& rows,
             const RecorderLiveness& liveness, std::size_t chunk_samples) {
  std::vector<std::int64_t> dead;
  Statement recorders = database.Prepare("SELECT recorder_id FROM recorder");
  while (recorders.Step()) {
    if (!liveness.IsAlive(recorders.Int64(0))) {
      dead.push_back(recorders.Int64(0));
    }
  }
  Statement runs =
      database.Prepare("SELECT run_id, samples FROM run WHERE recorder_id = ?");
  for (const std::int64_t recorder : dead) {
    std::vector<std::pair<std::int64_t, std::int64_t>> left;
    runs.Bind(recorder);
    while (runs.Step()) {
      left.emplace_back(runs.Int64(0), runs.Int64(1));
    }
    for (const auto& [run_id, samples] : left) {
      const std::vector<StoredSample> tail = rows.TakeTail(run_id);
      rows.InsertChunks(run_id,
                        samples - static_cast<std::int64_t>(tail.size()), tail,
                        chunk_samples);
      rows.SetState(run_id, RunState::kInterrupted);
    }
    database.Run("DELETE FROM recorder WHERE recorder_id = ?", recorder);
  }
}

}  // namespace

class RunRecorder::Impl {
 public:
  Impl(const std::filesystem::path& path, const RunRecorderOptions& options)
      : chunk_samples_(static_cast<std::size_t>(options.chunk_samples)),
        database_(path, RunsSchema(), Access::kWriter),
        rows_(database_),
        liveness_(path) {
    Transaction transaction(database_);
    Recover(database_, rows_, liveness_, chunk_samples_);
    database_.Run("INSERT INTO recorder (pid, started_ns) VALUES (?, ?)",
                  getpid(), UtcNow());
    recorder_id_ = database_.LastInsertRowid();
    liveness_.Claim(recorder_id_);
    transaction.Commit();
  }

  Key Begin(const NewRun& run) {
    const Key key = runs_.size();
    ids_.push_back(NewRunId());
    ActiveRun& active = *runs_.emplace_back(std::make_unique<ActiveRun>());
    active.run = run;
    // Of many valves that start at once not all shall fill a chunk at once.
    active.committed.threshold =
        chunk_samples_ / 2 + key * 37 % (chunk_samples_ / 2 + 1);
    Touch(key);
    return key;
  }

  void Append(Key key, const StoredSample& sample) {
    Require(runs_.at(key) != nullptr && !runs_[key]->end_asked,
            "a run that has ended takes no more samples");
    runs_[key]->pending.push_back(sample);
    ++pending_;
    Touch(key);
  }

  void End(Key key) {
    if (runs_.at(key) != nullptr) {
      runs_[key]->end_asked = true;
      Touch(key);
    }
  }

  void Commit() {
    if (dirty_.empty()) {
      return;
    }
    std::vector<ActiveRun::Committed> after;
    after.reserve(dirty_.size());
    Transaction transaction(database_);
    for (const Key key : dirty_) {
      after.push_back(Store(ids_[key], *runs_[key]));
    }
    transaction.Commit();
    for (std::size_t i = 0; i < dirty_.size(); ++i) {
      Adopt(dirty_[i], after[i]);
    }
    recorded_ += std::exchange(pending_, 0);
    dirty_.clear();
  }

  std::int64_t DropPending() {
    for (const Key key : dirty_) {
      runs_[key]->pending.clear();
    }
    return std::exchange(pending_, 0);
  }

  void Close() {
    for (Key key = 0; key < runs_.size(); ++key) {
      End(key);
    }
    Commit();
    if (recorder_id_ != 0) {
      Transaction transaction(database_);
      database_.Run("DELETE FROM recorder WHERE recorder_id = ?", recorder_id_);
      transaction.Commit();
      recorder_id_ = 0;
      database_.Checkpoint();
    }
  }

  const std::string& Id(Key key) const { return ids_.at(key); }
  std::int64_t pending() const { return pending_; }
  std::int64_t recorded() const { return recorded_; }
  Database& database() { return database_; }

 private:
  void Touch(Key key) {
    if (!std::exchange(runs_[key]->dirty, true)) {
      dirty_.push_back(key);
    }
  }

  /// Writes what is pending of a run. @returns its state once committed.
  ActiveRun::Committed Store(const std::string& id, ActiveRun& active) {
    ActiveRun::Committed after = active.committed;
    if (after.run_id == 0) {
      after.run_id = rows_.InsertRun(id, active.run, recorder_id_);
    }
    if (!active.pending.empty()) {
      RunCounters counters;
      for (const StoredSample& sample : active.pending) {
        counters.Count(sample);
      }
      rows_.AddCounters(after.run_id, counters);
    }
    const std::size_t loose = after.tail + active.pending.size();
    if (loose >= after.threshold || (active.end_asked && loose > 0)) {
      Compact(active, after);
    } else if (!active.pending.empty()) {
      rows_.InsertTail(after.run_id, after.samples, active.pending);
      after.tail = loose;
    }
    after.samples += static_cast<std::int64_t>(active.pending.size());
    if (active.end_asked && !after.ended) {
      rows_.SetState(after.run_id, RunState::kComplete);
      after.ended = true;
    }
    return after;
  }

  /// Tail and pending samples become chunks; less than one stays a tail row.
  void Compact(ActiveRun& active, ActiveRun::Committed& after) {
    std::vector<StoredSample> samples;
    if (after.tail > 0) {
      samples = rows_.TakeTail(after.run_id);
    }
    std::int64_t first =
        after.samples - static_cast<std::int64_t>(samples.size());
    samples.insert(samples.end(), active.pending.begin(), active.pending.end());
    std::span<const StoredSample> rest = samples;
    while (rest.size() >= after.threshold ||
           (active.end_asked && !rest.empty())) {
      const auto part = rest.first(std::min(rest.size(), chunk_samples_));
      rows_.InsertChunk(after.run_id, first, part, &active.hints);
      first += static_cast<std::int64_t>(part.size());
      rest = rest.subspan(part.size());
      after.threshold = chunk_samples_;
    }
    if (!rest.empty()) {
      rows_.InsertTail(after.run_id, first, rest);
    }
    after.tail = rest.size();
  }

  void Adopt(Key key, const ActiveRun::Committed& after) {
    if (after.ended) {
      runs_[key].reset();
      return;
    }
    runs_[key]->committed = after;
    runs_[key]->dirty = false;
    runs_[key]->pending.clear();
  }

  std::size_t chunk_samples_;
  Database database_;
  RunRows rows_;
  RecorderLiveness liveness_;
  std::int64_t recorder_id_{0};
  std::vector<std::string> ids_;                  // by Key
  std::vector<std::unique_ptr<ActiveRun>> runs_;  // by Key; null once it ended
  std::vector<Key> dirty_;  // runs with something to commit
  std::int64_t pending_{0};
  std::int64_t recorded_{0};
};

RunRecorder::RunRecorder(const std::filesystem::path& path,
                         const RunRecorderOptions& options) {
  Require(options.chunk_samples >= 1 &&
              options.chunk_samples <= static_cast<int>(kMaxChunkSamples),
          "chunk_samples is in 1..65536");
  impl_ = std::make_unique<Impl>(path, options);
}

RunRecorder::~RunRecorder() = default;

RunRecorder::Key RunRecorder::Begin(const NewRun& run) {
  Require(run.period_s > 0.0, "the sample period is positive");
  return impl_->Begin(run);
}

const std::string& RunRecorder::Id(Key run) const {
  return impl_->Id(run);
}

void RunRecorder::Append(Key run, const StoredSample& sample) {
  impl_->Append(run, sample);
}

void RunRecorder::Append(Key run, const LabelledSample& labelled) {
  StoredSample stored;
  stored.sample = labelled.sample;
  stored.truth = labelled.truth;
  impl_->Append(run, stored);
}

void RunRecorder::End(Key run) {
  impl_->End(run);
}

void RunRecorder::Commit() {
  impl_->Commit();
}

std::int64_t RunRecorder::DropPending() {
  return impl_->DropPending();
}

void RunRecorder::Close() {
  impl_->Close();
}

std::int64_t RunRecorder::pending() const {
  return impl_->pending();
}

std::int64_t RunRecorder::recorded() const {
  return impl_->recorded();
}

Database& RunRecorder::database() {
  return impl_->database();
}

}  // namespace fdi::storage
