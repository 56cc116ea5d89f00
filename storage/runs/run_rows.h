#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "storage/database/database.h"
#include "storage/runs/runs.h"

// How runs are written to the tables of runs.db, for RunStore and RunRecorder.
namespace fdi::storage {

/// Tells which recorders of a database live: each locks the byte of its number
/// in `<database>.live`. The kernel frees it when the process ends, however.
class RecorderLiveness {
 public:
  /// @throws DataError naming the file and the reason.
  explicit RecorderLiveness(const std::filesystem::path& database);
  ~RecorderLiveness();
  RecorderLiveness(const RecorderLiveness&) = delete;
  RecorderLiveness& operator=(const RecorderLiveness&) = delete;

  /// This object stands for recorder `id` until it is destroyed.
  void Claim(std::int64_t id);
  /// Is `id` claimed by another object, of this process or another one?
  bool IsAlive(std::int64_t id) const;

  /// As IsAlive(), for those who may not write the file.
  static bool IsAlive(const std::filesystem::path& database, std::int64_t id);

 private:
  std::filesystem::path path_;
  int file_;
};

/// 12 random hex digits.
std::string NewRunId();

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

// All below within a Transaction.

/// @param recorder that is at it; without one the run is complete.
/// @returns run_id.
std::int64_t InsertRun(Database& database, const std::string& id,
                       const NewRun& run, std::optional<std::int64_t> recorder);
void AddCounters(Database& database, std::int64_t run_id,
                 const RunCounters& counters);
/// Of a run that no recorder is at any more.
void SetState(Database& database, std::int64_t run_id, RunState state);

/// @param first index in the run of samples[0].
void InsertTail(Database& database, std::int64_t run_id, std::int64_t first,
                std::span<const StoredSample> samples);
void InsertChunk(Database& database, std::int64_t run_id, std::int64_t first,
                 std::span<const StoredSample> samples, ChunkHints* hints);
/// Cuts samples into chunks of at most `chunk_samples`.
void InsertChunks(Database& database, std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples,
                  std::size_t chunk_samples);
/// Removes the tail rows. @returns their samples in order.
std::vector<StoredSample> TakeTail(Database& database, std::int64_t run_id);

/// The samples of the row, whose columns are count, codec, crc, bytes, first.
/// @param where it stands, without the number of its first sample.
/// @throws DataError if the bytes are damaged.
std::vector<StoredSample> ReadBundle(const Statement& row,
                                     const std::string& where);

}  // namespace fdi::storage
