#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"
#include "storage/runs/column_codec.h"

namespace fdi::storage {

/// A received sample as recorded, with the outcome of its intake, so that
/// re-scoring reproduces what the engine saw.
struct StoredSample {
  Sample sample;
  std::optional<FaultTruth> truth;
  Intake intake{Intake::kAccepted};
  bool initialised{false};    ///< The observers were initialised here.
  bool model_swapped{false};  ///< First sample judged by another model set.
};

/// Encodings of a stored chunk; numbers are part of the file format.
enum class ChunkCodec : std::uint8_t {
  kPlain = 0,    ///< Fixed records, for the few samples of a tail row.
  kColumns = 1,  ///< Columns of differences, byte planes, zlib.
};

/// Consecutive samples of a run, as stored.
struct Chunk {
  ChunkCodec codec{ChunkCodec::kColumns};
  std::uint32_t crc{0};  ///< CRC-32 of codec, count and bytes.
  std::uint32_t count{0};
  std::vector<std::byte> bytes;
};

inline constexpr std::uint32_t kMaxChunkSamples = 65536;

/// Hints of a chunk of a run for the next one: the predictors of its
/// columns of doubles, which saves searching for them again.
struct ChunkHints {
  /// By signal; that of the strength of the truth is the last.
  std::array<std::optional<ValuePredictor>, kSignalCount + 1> columns;
};

/// Packs samples without loss, including NaN payloads and −0.
///
/// kColumns: every field of the samples is a column of 64-bit integers. A
/// column of doubles becomes integers n with value = n / 10^d, or with value =
/// a + q·n (the grid of a converter), plus corrections in units in the last
/// place; or the bits themselves. Each integer column is stored as first or
/// second differences, split into byte planes, and everything is deflated.
/// @throws std::invalid_argument if there are none or too many.
Chunk EncodeChunk(std::span<const StoredSample> samples, ChunkCodec codec,
                  ChunkHints* hints = nullptr);

/// @param where the chunk is stored, for error messages.
/// @throws DataError if CRC, sizes or values are not what EncodeChunk() writes.
std::vector<StoredSample> DecodeChunk(const Chunk& chunk,
                                      std::string_view where);

}  // namespace fdi::storage
