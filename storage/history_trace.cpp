#include "storage/history_trace.h"

#include <string>

#include <zlib.h>

#include "diagnosis/error.h"
#include "storage/bytes.h"
#include "storage/column_codec.h"

namespace fdi::storage {
namespace {

// Size that the columns never exceed.
constexpr std::uint32_t MaxRawBytes(std::uint32_t count, std::uint32_t channels,
                                    std::uint32_t faults) {
  return 2 * (4 + channels + faults) * (8 * count + 64);
}

std::uint32_t Crc(std::span<const std::byte> bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

template <typename Field>
std::vector<std::int64_t> IntegerColumn(std::span<const TraceInstant> instants,
                                        const Field& field) {
  std::vector<std::int64_t> column;
  column.reserve(instants.size());
  for (const TraceInstant& instant : instants) {
    column.push_back(static_cast<std::int64_t>(field(instant)));
  }
  return column;
}

template <typename Field>
std::vector<double> DoubleColumn(std::span<const TraceInstant> instants,
                                 const Field& field) {
  std::vector<double> column;
  column.reserve(instants.size());
  for (const TraceInstant& instant : instants) {
    column.push_back(field(instant));
  }
  return column;
}

ByteWriter Columns(std::span<const TraceInstant> instants) {
  using T = TraceInstant;
  ByteWriter raw;
  WriteIntegers(raw,
                IntegerColumn(instants, [](const T& i) { return i.quality; }));
  WriteIntegers(raw,
                IntegerColumn(instants, [](const T& i) { return i.state; }));
  WriteIntegers(raw,
                IntegerColumn(instants, [](const T& i) { return i.isolated; }));
  WriteDoubles(
      raw, DoubleColumn(instants, [](const T& i) { return i.normal_factor; }));
  for (std::size_t c = 0; c < instants.front().residuals.size(); ++c) {
    WriteDoubles(raw, DoubleColumn(instants,
                                   [c](const T& i) { return i.residuals[c]; }));
  }
  for (std::size_t f = 0; f < instants.front().fault_factors.size(); ++f) {
    WriteDoubles(raw, DoubleColumn(instants, [f](const T& i) {
                   return i.fault_factors[f];
                 }));
  }
  return raw;
}

std::vector<std::byte> Deflate(std::span<const std::byte> raw) {
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::vector<std::byte> packed(size);
  const int code = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                             reinterpret_cast<const Bytef*>(raw.data()),
                             static_cast<uLong>(raw.size()), 6);
  if (code != Z_OK) {
    throw std::runtime_error("zlib: compress2 fails with " +
                             std::to_string(code));
  }
  packed.resize(size);
  return packed;
}

std::vector<std::byte> Inflate(std::span<const std::byte> packed,
                               std::uint32_t size, std::string_view where) {
  std::vector<std::byte> raw(size);
  uLongf got = size;
  const int code = uncompress(reinterpret_cast<Bytef*>(raw.data()), &got,
                              reinterpret_cast<const Bytef*>(packed.data()),
                              static_cast<uLong>(packed.size()));
  if (code != Z_OK || got != size) {
    throw DataError(std::string(where) + " is damaged: zlib says " +
                    std::to_string(code));
  }
  return raw;
}

template <typename Enum>
Enum CheckedEnum(std::int64_t value, Enum last, const ByteReader& reader) {
  if (value < 0 || value > static_cast<std::int64_t>(last)) {
    reader.Refuse("value " + std::to_string(value) + " has no name");
  }
  return static_cast<Enum>(value);
}

void ReadColumns(ByteReader& reader, std::uint32_t channels,
                 std::uint32_t faults, std::vector<TraceInstant>& instants) {
  const std::size_t count = instants.size();
  const auto quality = ReadIntegers(reader, count);
  const auto state = ReadIntegers(reader, count);
  const auto isolated = ReadIntegers(reader, count);
  const auto normal = ReadDoubles(reader, count);
  for (std::size_t i = 0; i < count; ++i) {
    instants[i].quality = CheckedEnum(quality[i], Quality::kUnassigned, reader);
    instants[i].state = CheckedEnum(state[i], State::kIsolated, reader);
    instants[i].isolated = static_cast<FaultSet>(isolated[i]);
    instants[i].normal_factor = normal[i];
    instants[i].residuals.resize(channels);
    instants[i].fault_factors.resize(faults);
  }
  for (std::size_t c = 0; c < channels; ++c) {
    const auto column = ReadDoubles(reader, count);
    for (std::size_t i = 0; i < count; ++i) {
      instants[i].residuals[c] = column[i];
    }
  }
  for (std::size_t f = 0; f < faults; ++f) {
    const auto column = ReadDoubles(reader, count);
    for (std::size_t i = 0; i < count; ++i) {
      instants[i].fault_factors[f] = column[i];
    }
  }
}

}  // namespace

TraceChunk EncodeTrace(std::span<const TraceInstant> instants) {
  Require(!instants.empty(), "EncodeTrace: no instants");
  const std::size_t channels = instants.front().residuals.size();
  const std::size_t faults = instants.front().fault_factors.size();
  std::vector<StoredSample> samples;
  samples.reserve(instants.size());
  for (const TraceInstant& instant : instants) {
    Require(instant.residuals.size() == channels &&
                instant.fault_factors.size() == faults,
            "EncodeTrace: instants of different sizes");
    samples.push_back(instant.received);
  }
  TraceChunk chunk;
  chunk.samples = EncodeChunk(samples, ChunkCodec::kColumns);
  const ByteWriter raw = Columns(instants);
  ByteWriter writer;
  writer.Put(static_cast<std::uint32_t>(instants.size()));
  writer.Put(static_cast<std::uint32_t>(channels));
  writer.Put(static_cast<std::uint32_t>(faults));
  writer.Put(static_cast<std::uint32_t>(raw.size()));
  const std::vector<std::byte> packed = Deflate(raw.view());
  writer.Append(packed.data(), packed.size());
  chunk.vectors = writer.Take();
  chunk.vector_crc = Crc(chunk.vectors);
  return chunk;
}

std::vector<TraceInstant> DecodeTrace(const TraceChunk& chunk,
                                      std::string_view where) {
  if (Crc(chunk.vectors) != chunk.vector_crc) {
    throw DataError(std::string(where) + " is damaged: CRC-32 differs");
  }
  const std::vector<StoredSample> samples = DecodeChunk(chunk.samples, where);
  ByteReader header(chunk.vectors, where);
  const std::uint32_t count = header.GetCount(kMaxChunkSamples, "instants");
  const std::uint32_t channels = header.GetCount(kMaxChannels, "channels");
  const std::uint32_t faults = header.GetCount(kMaxFaults, "faults");
  const std::uint32_t size =
      header.GetCount(MaxRawBytes(count, channels, faults), "size");
  if (count != samples.size()) {
    header.Refuse("samples and vectors differ in number");
  }
  constexpr std::size_t kHeaderBytes = 4 * sizeof(std::uint32_t);
  const std::vector<std::byte> raw =
      Inflate(std::span(chunk.vectors).subspan(kHeaderBytes), size, where);
  std::vector<TraceInstant> instants(count);
  for (std::size_t i = 0; i < count; ++i) {
    instants[i].received = samples[i];
  }
  ByteReader columns(raw, where);
  ReadColumns(columns, channels, faults, instants);
  columns.ExpectEnd();
  return instants;
}

}  // namespace fdi::storage
