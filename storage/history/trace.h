#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string_view>
#include <vector>

#include "diagnosis/records/trace_point.h"
#include "storage/database/database.h"
#include "storage/runs/sample_codec.h"

namespace fdi::storage {

/// Consecutive instants of an episode, as stored.
struct TraceChunk {
  Chunk samples;
  std::uint32_t vector_crc{0};
  std::vector<std::byte> vectors;
};

inline constexpr int kTraceChunkInstants = 300;

/// Packs instants without loss; see trace.cpp for the format.
/// @throws std::invalid_argument if there are none or their sizes differ.
TraceChunk EncodeTrace(std::span<const TracePoint> instants);

/// @param where the chunk is stored, for error messages.
/// @throws DataError if the bytes are not what EncodeTrace() writes.
std::vector<TracePoint> DecodeTrace(const TraceChunk& chunk,
                                    std::string_view where);

/// The traces of the episodes being recorded: buffers instants and stores them
/// in chunks. The last chunk of an episode is replaced by a longer one until it
/// is full, so that a crash loses only what was not committed.
class TraceWriter {
 public:
  explicit TraceWriter(Database& database) : database_(database) {}

  /// Like the functions of HistoryWriter with these names.
  bool Append(std::uint64_t episode_id, std::span<const TracePoint> instants);
  void End(std::uint64_t episode_id);
  void EndAll();
  /// The peak factor refers to this set from now on.
  void SetIsolated(std::uint64_t episode_id, FaultSet isolated);

  bool HasPending() const;
  /// Within a transaction: writes what is not in the file yet.
  void Store();
  /// After the commit: discards the instants of full chunks.
  void DiscardCommitted();
  /// Discards everything that is not stored.
  void DropPending() { buffers_.clear(); }

 private:
  // The instants of an episode that are not yet in full chunks.
  struct Buffer {
    std::vector<TracePoint> instants;
    std::int64_t chunk{0};  // Number of the chunk that begins at instants[0].
    std::size_t channels{0};
    std::size_t faults{0};
    FaultSet isolated{0};
    std::int64_t detected_ns{0};
    bool dirty{false};
    bool ended{false};
  };
  static double Peak(const Buffer& buffer);
  Buffer& BufferOf(std::uint64_t episode_id);
  void StoreBuffer(std::uint64_t episode_id, const Buffer& buffer);

  Database& database_;
  std::map<std::uint64_t, Buffer> buffers_;
};

}  // namespace fdi::storage
