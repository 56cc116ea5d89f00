#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "storage/csv.h"
#include "storage/database.h"
#include "storage/run_types.h"

namespace fdi::storage {

/// Schema of runs.db: tables run, run_label, chunk, tail, recorder and the view
/// run_summary; see docs/data.md.
const Schema& RunsSchema();

/// Reads runs.db and, opened as an occasional writer, imports, labels and
/// deletes. One thread at a time.
class RunStore {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit RunStore(const std::filesystem::path& path,
                    Access access = Access::kReader);
  ~RunStore();
  RunStore(RunStore&&) noexcept;
  RunStore& operator=(RunStore&&) noexcept;

  /// By start.
  std::vector<RunInfo> List(const RunFilter& filter = {});

  /// `selector` as in ParseRunSelector(); its stretch is ignored.
  /// @throws NotFoundError if no run, or more than one, begins like that.
  RunInfo Info(std::string_view selector);

  /// @throws NotFoundError as Info(), or if the stretch holds no sample.
  /// @throws DataError naming run and chunk if stored bytes are damaged.
  StoredRun Load(std::string_view selector);

  /// Stores all runs of a table, or none. @returns their ids, in order.
  /// `run`: valve, source, start (of t_s = 0), scenario and software count;
  /// the rest is the table's. A split table makes runs that each start at
  /// their first sample.
  std::vector<std::string> Import(const CsvTable& table, const NewRun& run);

  /// Says what was true in a stretch; later labels win.
  void Label(std::string_view selector, int fault, double strength);
  /// @returns how many labels the run had.
  int RemoveLabels(std::string_view selector);
  void Delete(std::string_view selector);

  Database& database();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Settings of RunRecorder.
struct RunRecorderOptions {
  int chunk_samples{600};  ///< Samples of a full chunk.
};

/// Records many runs at once through one connection. Append() only buffers;
/// Commit(), which the caller's clock calls each second, stores what is pending
/// of all runs in one transaction: in the tail table, and as a chunk once there
/// is enough for one. What was committed outlives kill -9: runs whose recorder
/// died become `interrupted` when the next one opens the file.
/// One thread at a time. Several recorders may share a file.
class RunRecorder {
 public:
  /// Names a run within this recorder.
  using Key = std::size_t;

  /// @throws DataError, SqliteError as Database.
  explicit RunRecorder(const std::filesystem::path& path,
                       const RunRecorderOptions& options = {});
  /// Drops what was not committed, as a crash would; see Close().
  ~RunRecorder();
  RunRecorder(const RunRecorder&) = delete;
  RunRecorder& operator=(const RunRecorder&) = delete;

  /// Begins a run; it is in the file from the next Commit() on.
  Key Begin(const NewRun& run);
  /// Its id, known from the start.
  const std::string& Id(Key run) const;

  void Append(Key run, const StoredSample& sample);
  void Append(Key run, const LabelledSample& sample);

  /// Ends a run: the next Commit() compacts it and marks it complete.
  void End(Key run);

  /// Stores all that is pending. After an error everything is still pending:
  /// call again, or drop it. @throws SqliteError
  void Commit();
  /// Drops what is pending, e.g. while the disk is full.
  /// @returns the number of samples; they are missing from the runs.
  std::int64_t DropPending();

  /// Ends all runs, commits and checkpoints. @throws SqliteError
  void Close();

  std::int64_t pending() const;   ///< Samples appended, not committed.
  std::int64_t recorded() const;  ///< Samples committed.
  Database& database();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi::storage
