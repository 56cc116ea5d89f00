#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "storage/history_types.h"

namespace fdi::storage {

/// Consecutive instants of an episode, as stored.
struct TraceChunk {
  Chunk samples;
  std::uint32_t vector_crc{0};
  std::vector<std::byte> vectors;
};

inline constexpr int kTraceChunkInstants = 300;

/// Packs instants without loss. `vectors`: instants, channels, faults and size
/// as uint32, then the zlib stream of the columns quality, state, isolated,
/// d_0, residuals by channel, factors by fault (see column_codec.h).
/// @throws std::invalid_argument if there are none or their sizes differ.
TraceChunk EncodeTrace(std::span<const TraceInstant> instants);

/// @param where the chunk stands, for the message.
/// @throws DataError if the bytes are not what EncodeTrace() writes.
std::vector<TraceInstant> DecodeTrace(const TraceChunk& chunk,
                                      std::string_view where);

}  // namespace fdi::storage
