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

// Writes runs to the tables of runs.db, for RunStore and RunRecorder.
namespace fdi::storage {

/// Tells which recorders of a database are alive: each locks the byte at its id
/// in `<database>.live`. The kernel releases the lock however the process ends.
class RecorderLiveness {
 public:
  /// @throws DataError naming the file and the reason.
  explicit RecorderLiveness(const std::filesystem::path& database);
  ~RecorderLiveness();
  RecorderLiveness(const RecorderLiveness&) = delete;
  RecorderLiveness& operator=(const RecorderLiveness&) = delete;

  /// Makes this object represent recorder `id` until it is destroyed.
  void Claim(std::int64_t id);
  /// True if another object, in this or another process, has claimed `id`.
  bool IsAlive(std::int64_t id) const;

  /// Like IsAlive(), for callers without write permission on the file.
  static bool IsAlive(const std::filesystem::path& database, std::int64_t id);
  /// The ids that are claimed.
  static std::vector<std::int64_t> Alive(const std::filesystem::path& database);

 private:
  std::filesystem::path path_;
  int file_;
};

/// 12 random hex digits.
std::string NewRunId();

/// Additions of a bundle of samples to its run's row.
struct RunCounters {
  std::int64_t samples{0};
  std::int64_t truth_samples{0};
  std::int64_t first_stamp_ns{std::numeric_limits<std::int64_t>::max()};
  std::int64_t last_stamp_ns{std::numeric_limits<std::int64_t>::min()};
  SignalMask signals{0};
  std::array<std::int64_t, kIntakeCount> intake{};

  void Count(const StoredSample& sample);
};

// The functions below must be called within a Transaction.

/// @param recorder that records the run; without one the run is complete.
/// @returns run_id.
std::int64_t InsertRun(Database& database, const std::string& id,
                       const NewRun& run, std::optional<std::int64_t> recorder);
void AddCounters(Database& database, std::int64_t run_id,
                 const RunCounters& counters);
/// For a run that is no longer being recorded.
void SetState(Database& database, std::int64_t run_id, RunState state);

/// @param first index in the run of samples[0].
void InsertTail(Database& database, std::int64_t run_id, std::int64_t first,
                std::span<const StoredSample> samples);
void InsertChunk(Database& database, std::int64_t run_id, std::int64_t first,
                 std::span<const StoredSample> samples, ChunkHints* hints);
/// Splits samples into chunks of at most `chunk_samples`.
void InsertChunks(Database& database, std::int64_t run_id, std::int64_t first,
                  std::span<const StoredSample> samples,
                  std::size_t chunk_samples);
/// Removes the tail rows. @returns their samples in order.
/// @throws DataError if one is damaged; none is removed then.
std::vector<StoredSample> TakeTail(Database& database, std::int64_t run_id);

/// Decodes the samples of a row with columns count, codec, crc, bytes, first.
/// @param where the row is, without the number of its first sample.
/// @throws DataError if the bytes are damaged.
std::vector<StoredSample> ReadBundle(const Statement& row,
                                     const std::string& where);

}  // namespace fdi::storage
