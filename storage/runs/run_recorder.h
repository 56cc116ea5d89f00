#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "diagnosis/model/sample_series.h"
#include "storage/database/database.h"
#include "storage/runs/run_rows.h"
#include "storage/runs/runs.h"

namespace fdi::storage {

/// Settings of RunRecorder.
struct RunRecorderOptions {
  int chunk_samples{600};  ///< Samples of a full chunk.
};

/// Records many runs at once through one connection. Append() only buffers;
/// Commit(), which the monitor calls every 0.75 s, stores what is pending of
/// all runs in one transaction: in the tail table, and as a chunk once there
/// are enough samples. Committed samples survive kill -9: runs whose recorder
/// died become `interrupted` when the next one opens the file. Destroying the
/// recorder drops what was not committed, as a crash would; see Close(). One
/// thread at a time. Several recorders may share a file.
class RunRecorder {
 public:
  /// Identifies a run within this recorder.
  using Key = std::size_t;

  /// @throws DataError, SqliteError as Database.
  explicit RunRecorder(const std::filesystem::path& path,
                       const RunRecorderOptions& options = {});

  /// Begins a run; the next Commit() writes it to the file.
  Key Begin(const NewRun& run);
  /// Its id, available until the end of the run is committed, after which
  /// nothing of the run is kept.
  /// @throws std::invalid_argument for a run that has ended.
  const std::string& Id(Key run) const;

  /// Corrects the sample period that Begin() was given.
  void SetPeriod(Key run, double period_s);

  void Append(Key run, const StoredSample& sample);
  void Append(Key run, const LabelledSample& sample);

  /// Ends a run: the next Commit() compacts it and marks it complete.
  void End(Key run);

  /// Goes on in the file of this name if the one that is open was deleted or
  /// replaced (Database::Refresh()): there, each run begins with its first
  /// sample that was not committed, under another id. @returns whether it did.
  bool Refresh();

  /// Commits everything pending. After an error it is still pending: retry or
  /// drop it. @throws SqliteError
  void Commit();
  /// Drops pending samples, for example while the disk is full.
  /// @returns the number of samples; they are missing from the runs.
  std::int64_t DropPending();

  /// Ends all runs, commits and checkpoints. @throws SqliteError
  void Close();

  /// Samples appended but not committed.
  std::int64_t pending() const { return pending_; }
  /// Samples committed.
  std::int64_t recorded() const { return recorded_; }
  Database& database() { return database_; }

 private:
  /// The part of a run that the file contains.
  struct Committed {
    std::int64_t run_id{0};  ///< 0: no row yet.
    std::int64_t samples{0};
    double period_s{0.0};
    std::size_t tail{0};       ///< Those in the tail table.
    std::size_t threshold{0};  ///< Tail length that triggers compaction.
    bool ended{false};
  };
  struct ActiveRun {
    std::string id;
    NewRun run;
    Committed committed;
    std::vector<StoredSample> pending;
    ChunkHints hints;
    bool end_asked{false};
    bool dirty{false};
    bool moved{false};  // By Refresh(), and without a sample since.
  };

  void Announce();
  ActiveRun& Active(Key key);
  void Touch(Key key, ActiveRun& active);
  Committed Store(ActiveRun& active);
  void Compact(ActiveRun& active, Committed& after);

  std::size_t chunk_samples_;
  Database database_;
  std::optional<RecorderLiveness> liveness_;
  std::int64_t recorder_id_{0};
  bool moved_{false};  // Into a file that does not know this recorder yet.
  Key next_key_{0};
  std::unordered_map<Key, ActiveRun> runs_;
  std::vector<Key> dirty_;  // Runs with something to commit.
  std::int64_t pending_{0};
  std::int64_t recorded_{0};
};

}  // namespace fdi::storage
