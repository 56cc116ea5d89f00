#include "storage/runs/sample_codec.h"

#include <array>
#include <bit>
#include <limits>
#include <string>

#include "base/error.h"
#include "storage/database/bytes.h"
#include "storage/runs/column_codec.h"

namespace fdi::storage {

// The bytes of a chunk, little endian; its count, codec and CRC-32 are separate
// columns of the row:
//
//   plain   = record*
//   record  = mask:uint32 word:uint64*     bit i of the mask: number i is not 0
//   columns = size:uint32 deflated         size of what is deflated
//   deflated = zlib of: integers * 11, doubles * 12
//
// The 23 numbers of a sample, in this order: stamp, source, seq, present,
// qualities (2 bits each), mode, flow unit, epoch, intake, flags, fault of the
// truth; the eleven values by signal, strength of the truth. A column of
// integers or doubles is as in column_codec.cpp.
namespace {

constexpr unsigned kQualityBits = 2;
constexpr std::int64_t kInitialised = 1;
constexpr std::int64_t kModelSwapped = 2;
constexpr std::int64_t kHasTruth = 4;

/// A StoredSample as plain numbers.
struct Row {
  static constexpr std::size_t kIntegers = 11;
  static constexpr std::size_t kDoubles = kSignalCount + 1;
  // stamp, source, seq, present, quality, mode, flow unit, epoch, intake,
  // flags, fault
  std::array<std::int64_t, kIntegers> integers{};
  std::array<double, kSignalCount> values{};
  double strength{0.0};  // Strength in the truth.

  double& Double(std::size_t i) {
    return i < kSignalCount ? values[i] : strength;
  }
};

/// Upper bound of the inflated size of a chunk of `count` samples.
std::size_t MaxInflated(std::size_t count) {
  // A column of doubles is at most two of integers behind its kind, origin and
  // step (17 bytes). A column of integers is at most its form, two seeds and
  // the width (18 bytes), and 8 bytes for every sample. So 64 bytes beside the
  // samples suffice for each.
  return (Row::kIntegers + 2 * Row::kDoubles) * (8 * count + 64);
}

Row ToRow(const StoredSample& stored) {
  const Sample& s = stored.sample;
  std::int64_t quality = 0;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    quality |= static_cast<std::int64_t>(s.quality[i]) << (kQualityBits * i);
  }
  const std::int64_t flags = (stored.initialised ? kInitialised : 0) |
                             (stored.model_swapped ? kModelSwapped : 0) |
                             (stored.truth ? kHasTruth : 0);
  Row row;
  row.integers = {s.stamp_ns,
                  static_cast<std::int64_t>(s.source_id),
                  static_cast<std::int64_t>(s.seq),
                  s.present,
                  quality,
                  static_cast<std::int64_t>(s.mode),
                  static_cast<std::int64_t>(s.flow_unit),
                  s.epoch,
                  static_cast<std::int64_t>(stored.intake),
                  flags,
                  stored.truth ? stored.truth->fault : 0};
  row.values = s.values;
  row.strength = stored.truth ? stored.truth->strength : 0.0;
  return row;
}

/// Checks that an integer is in 0 .. max.
std::int64_t Within(std::int64_t value, std::int64_t max, const char* what,
                    const ByteReader& reader) {
  if (value < 0 || value > max) {
    reader.Refuse(std::string(what) + " " + std::to_string(value));
  }
  return value;
}

StoredSample FromRow(const Row& row, const ByteReader& reader) {
  const auto& n = row.integers;
  StoredSample stored;
  Sample& s = stored.sample;
  s.stamp_ns = n[0];
  s.source_id = static_cast<std::uint64_t>(n[1]);
  s.seq = static_cast<std::uint64_t>(n[2]);
  s.present = static_cast<SignalMask>(
      Within(n[3], (1 << kSignalCount) - 1, "signals", reader));
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    s.quality[i] = static_cast<SignalQuality>(
        Within((n[4] >> (kQualityBits * i)) & 3,
               static_cast<int>(SignalQuality::kBad), "quality", reader));
  }
  s.mode = static_cast<ValveMode>(
      Within(n[5], static_cast<int>(ValveMode::kCalibrating), "mode", reader));
  s.flow_unit = static_cast<FlowUnit>(
      Within(n[6], static_cast<int>(FlowUnit::kTPerHour), "flow unit", reader));
  s.epoch = static_cast<std::uint32_t>(
      Within(n[7], std::numeric_limits<std::uint32_t>::max(), "epoch", reader));
  stored.intake =
      static_cast<Intake>(Within(n[8], kIntakeCount - 1, "intake", reader));
  const std::int64_t flags = Within(n[9], 7, "flags", reader);
  stored.initialised = (flags & kInitialised) != 0;
  stored.model_swapped = (flags & kModelSwapped) != 0;
  if ((flags & kHasTruth) != 0) {
    stored.truth = FaultTruth{
        static_cast<int>(
            Within(n[10], std::numeric_limits<int>::max(), "fault", reader)),
        row.strength};
  }
  s.values = row.values;
  return stored;
}

// Covers codec, count and bytes, so that damage to any part of the row is
// detected.
std::uint32_t ChecksumOf(const Chunk& chunk) {
  ByteWriter all;
  all.Put(static_cast<std::uint8_t>(chunk.codec));
  all.Put(chunk.count);
  all.Append(chunk.bytes.data(), chunk.bytes.size());
  return Crc32(all.view());
}

std::vector<std::byte> EncodeColumns(std::span<const StoredSample> samples,
                                     ChunkHints* hints) {
  std::vector<Row> rows;
  rows.reserve(samples.size());
  for (const StoredSample& sample : samples) {
    rows.push_back(ToRow(sample));
  }
  ByteWriter writer;
  std::vector<std::int64_t> integers(rows.size());
  for (std::size_t c = 0; c < Row::kIntegers; ++c) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      integers[i] = rows[i].integers[c];
    }
    WriteIntegers(writer, integers);
  }
  std::vector<double> doubles(rows.size());
  for (std::size_t c = 0; c < Row::kDoubles; ++c) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      doubles[i] = rows[i].Double(c);
    }
    WriteDoubles(writer, doubles,
                 hints != nullptr ? &hints->columns[c] : nullptr);
  }
  ByteWriter chunk;
  chunk.Put(static_cast<std::uint32_t>(writer.size()));
  const std::vector<std::byte> packed = Deflate(writer.view());
  chunk.Append(packed.data(), packed.size());
  return chunk.Take();
}

std::vector<StoredSample> DecodeColumns(const Chunk& chunk,
                                        std::string_view where) {
  ByteReader packed(chunk.bytes, where);
  const std::uint32_t size =
      packed.GetCount(static_cast<std::uint32_t>(MaxInflated(chunk.count)),
                      "size of inflated chunk");
  const std::vector<std::byte> raw =
      Inflate(packed.TakeBytes(chunk.bytes.size() - sizeof size), size, where);
  ByteReader reader(raw, where);
  std::vector<Row> rows(chunk.count);
  for (std::size_t c = 0; c < Row::kIntegers; ++c) {
    const auto column = ReadIntegers(reader, rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i].integers[c] = column[i];
    }
  }
  for (std::size_t c = 0; c < Row::kDoubles; ++c) {
    const auto column = ReadDoubles(reader, rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i].Double(c) = column[i];
    }
  }
  reader.ExpectEnd();
  std::vector<StoredSample> samples;
  samples.reserve(rows.size());
  for (const Row& row : rows) {
    samples.push_back(FromRow(row, reader));
  }
  return samples;
}

/// Zero words (all bits 0) are omitted and marked in the record's mask.
std::vector<std::byte> EncodePlain(std::span<const StoredSample> samples) {
  ByteWriter writer;
  for (const StoredSample& sample : samples) {
    Row row = ToRow(sample);
    std::array<std::uint64_t, Row::kIntegers + Row::kDoubles> words{};
    std::uint32_t mask = 0;
    for (std::size_t i = 0; i < words.size(); ++i) {
      words[i] =
          i < Row::kIntegers
              ? static_cast<std::uint64_t>(row.integers[i])
              : std::bit_cast<std::uint64_t>(row.Double(i - Row::kIntegers));
      mask |= words[i] != 0 ? 1U << i : 0U;
    }
    writer.Put(mask);
    for (const std::uint64_t word : words) {
      if (word != 0) {
        writer.Put(word);
      }
    }
  }
  return writer.Take();
}

std::vector<StoredSample> DecodePlain(const Chunk& chunk,
                                      std::string_view where) {
  ByteReader reader(chunk.bytes, where);
  std::vector<StoredSample> samples;
  samples.reserve(chunk.count);
  for (std::uint32_t k = 0; k < chunk.count; ++k) {
    Row row;
    const auto mask = reader.Get<std::uint32_t>();
    for (std::size_t i = 0; i < Row::kIntegers + Row::kDoubles; ++i) {
      const std::uint64_t word =
          (mask >> i & 1U) != 0 ? reader.Get<std::uint64_t>() : 0;
      if (i < Row::kIntegers) {
        row.integers[i] = static_cast<std::int64_t>(word);
      } else {
        row.Double(i - Row::kIntegers) = std::bit_cast<double>(word);
      }
    }
    samples.push_back(FromRow(row, reader));
  }
  reader.ExpectEnd();
  return samples;
}

}  // namespace

Chunk EncodeChunk(std::span<const StoredSample> samples, ChunkCodec codec,
                  ChunkHints* hints) {
  Require(!samples.empty() && samples.size() <= kMaxChunkSamples,
          "a chunk holds 1 to 65536 samples");
  Chunk chunk;
  chunk.codec = codec;
  chunk.count = static_cast<std::uint32_t>(samples.size());
  chunk.bytes = codec == ChunkCodec::kPlain ? EncodePlain(samples)
                                            : EncodeColumns(samples, hints);
  chunk.crc = ChecksumOf(chunk);
  return chunk;
}

std::vector<StoredSample> DecodeChunk(const Chunk& chunk,
                                      std::string_view where) {
  const ByteReader refuser({}, where);
  // The checksum covers the count, but only a limit keeps bytes with a forged
  // checksum from claiming any amount of memory.
  if (chunk.count == 0 || chunk.count > kMaxChunkSamples) {
    refuser.Refuse("it counts " + std::to_string(chunk.count) + " samples");
  }
  if (ChecksumOf(chunk) != chunk.crc) {
    refuser.Refuse("its CRC-32 differs");
  }
  switch (chunk.codec) {
    case ChunkCodec::kPlain:
      return DecodePlain(chunk, where);
    case ChunkCodec::kColumns:
      return DecodeColumns(chunk, where);
  }
  refuser.Refuse("unknown codec " +
                 std::to_string(static_cast<int>(chunk.codec)));
}

}  // namespace fdi::storage
