#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/run_types.h"

namespace fdi::storage {

/// 12 random hex digits.
std::string NewRunId();

/// ns UTC.
std::int64_t UtcNow();

/// What a bundle of samples adds to the row of its run.
struct RunCounters {
  std::int64_t samples{0};
  std::int64_t truth_samples{0};
  std::int64_t first_stamp_ns{std::numeric_limits<std::int64_t>::max()};
  std::int64_t last_stamp_ns{std::numeric_limits<std::int64_t>::min()};
  SignalMask signals{0};
  std::array<std::int64_t, kIntakeCount> intake{};

  void Count(const StoredSample& sample);
};

/// The writing statements of runs.db, prepared once. All within a Transaction.
class RunRows {
 public:
  explicit RunRows(Database& database);

  /// @param recorder that is at it; without one the run is complete.
  /// @returns run_id.
  std::int64_t InsertRun(const std::string& id, const NewRun& run,
                         std::optional<std::int64_t> recorder);
  void AddCounters(std::int64_t run_id, const RunCounters& counters);
  void SetState(std::int64_t run_id, RunState state);

  void InsertTail(std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples);
  void InsertChunk(std::int64_t run_id, std::int64_t first,
                   std::span<const StoredSample> samples,
                   ChunkHints* hints = nullptr);
  /// Removes the tail rows. @returns their samples in order.
  std::vector<StoredSample> TakeTail(std::int64_t run_id);
  /// Cuts samples into chunks of at most `chunk_samples`.
  void InsertChunks(std::int64_t run_id, std::int64_t first,
                    std::span<const StoredSample> samples,
                    std::size_t chunk_samples);

 private:
  Database& database_;
  Statement insert_run_;
  Statement add_counters_;
  Statement set_state_;
  Statement insert_tail_;
  Statement insert_chunk_;
  Statement select_tail_;
  Statement delete_tail_;
};

/// Columns count, codec, crc, bytes of a chunk or tail row, from `column` on.
Chunk ChunkOf(const Statement& row, int column);

}  // namespace fdi::storage
