#include "storage/history/trace.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "base/error.h"
#include "storage/database/bytes.h"
#include "storage/history/certainty.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"
#include "storage/history/sql.h"
#include "storage/runs/column_codec.h"

namespace fdi::storage {
namespace sql = history_sql;

// A chunk of a trace is two blobs. The samples are a chunk of sample_codec.h;
// the vectors are stored beside them, with a CRC-32 of their own:
//
//   vectors  = instants channels faults size  deflated
//   deflated = zlib of: quality state isolated d_0
//              residual * channels  factor * faults
//
// The four numbers are uint32, little endian; `size` is that of the columns
// before zlib. Every name of the columns is one column over all instants, of
// integers (quality, state, isolated) or of doubles: see column_codec.h.
namespace {

// Upper bound of the size of the columns: one of doubles is at most two of
// integers, each with 8 bytes per instant and fewer than 64 beside them. With
// the limits that DecodeTrace() has checked it is below 2²⁷ and cannot
// overflow.
constexpr std::uint32_t MaxRawBytes(std::uint32_t count, std::uint32_t channels,
                                    std::uint32_t faults) {
  return 2 * (4 + channels + faults) * (8 * count + 64);
}

template <typename Field>
std::vector<std::int64_t> IntegerColumn(std::span<const TracePoint> instants,
                                        const Field& field) {
  std::vector<std::int64_t> column;
  column.reserve(instants.size());
  for (const TracePoint& instant : instants) {
    column.push_back(static_cast<std::int64_t>(field(instant)));
  }
  return column;
}

template <typename Field>
std::vector<double> DoubleColumn(std::span<const TracePoint> instants,
                                 const Field& field) {
  std::vector<double> column;
  column.reserve(instants.size());
  for (const TracePoint& instant : instants) {
    column.push_back(field(instant));
  }
  return column;
}

ByteWriter Columns(std::span<const TracePoint> instants) {
  using T = TracePoint;
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
  for (std::size_t f = 0; f < instants.front().factors.size(); ++f) {
    WriteDoubles(
        raw, DoubleColumn(instants, [f](const T& i) { return i.factors[f]; }));
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
                 std::uint32_t faults, std::vector<TracePoint>& instants) {
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
    instants[i].factors.resize(faults);
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
      instants[i].factors[f] = column[i];
    }
  }
}

}  // namespace

TraceChunk EncodeTrace(std::span<const TracePoint> instants) {
  Require(!instants.empty(), "EncodeTrace: no instants");
  const std::size_t channels = instants.front().residuals.size();
  const std::size_t faults = instants.front().factors.size();
  std::vector<StoredSample> samples;
  samples.reserve(instants.size());
  for (const TracePoint& instant : instants) {
    Require(instant.residuals.size() == channels &&
                instant.factors.size() == faults,
            "EncodeTrace: instants of different sizes");
    StoredSample& stored = samples.emplace_back();
    stored.sample = instant.sample;
    stored.intake = instant.intake;
    stored.initialised = instant.initialised;
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
  chunk.vector_crc = Crc32(chunk.vectors);
  return chunk;
}

std::vector<TracePoint> DecodeTrace(const TraceChunk& chunk,
                                    std::string_view where) {
  if (Crc32(chunk.vectors) != chunk.vector_crc) {
    throw DataError(std::string(where) + " is damaged: CRC-32 differs");
  }
  const std::vector<StoredSample> samples = DecodeChunk(chunk.samples, where);
  ByteReader header(chunk.vectors, where);
  // Each count is limited, and `size` by them, before the columns take memory.
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
  std::vector<TracePoint> instants(count);
  for (std::size_t i = 0; i < count; ++i) {
    instants[i].sample = samples[i].sample;
    instants[i].intake = samples[i].intake;
    instants[i].initialised = samples[i].initialised;
  }
  ByteReader columns(raw, where);
  ReadColumns(columns, channels, faults, instants);
  columns.ExpectEnd();
  return instants;
}

// Largest factor of the isolated set or, before isolation, of any fault.
double TraceWriter::Peak(const Buffer& buffer) {
  double peak = 0.0;
  for (const TracePoint& instant : buffer.instants) {
    // The instants before the detection lead up to the episode, and those with
    // another isolated set do not count for the peak of this one.
    if (instant.sample.stamp_ns < buffer.detected_ns ||
        instant.isolated != buffer.isolated) {
      continue;
    }
    for (std::size_t f = 0; f < instant.factors.size(); ++f) {
      if (buffer.isolated == 0 || (buffer.isolated >> f & 1U) != 0) {
        // A NaN compares false and is ignored.
        peak = std::max(peak, instant.factors[f]);
      }
    }
  }
  return peak;
}

TraceWriter::Buffer& TraceWriter::BufferOf(std::uint64_t episode_id) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    return found->second;
  }
  const std::string id = EpisodeIdText(episode_id);
  Statement row = database_.Prepare(sql::trace_state);
  if (!row.Bind(id).Step()) {
    throw NotFoundError("no episode " + id);
  }
  Buffer buffer;
  buffer.channels = SplitNames(row.Text(0)).size();
  buffer.faults = SplitNames(row.Text(1)).size();
  buffer.isolated = row.Uint64(2);
  buffer.detected_ns = row.Int64(3);
  // The next chunk begins here even if the last one stored is not full: its
  // instants are no longer in memory, so it cannot be extended.
  buffer.chunk = row.Int64(4);
  return buffers_.emplace(episode_id, std::move(buffer)).first->second;
}

bool TraceWriter::Append(std::uint64_t episode_id,
                         std::span<const TracePoint> instants) {
  // All sizes are checked first, so that the instants are kept all or not at
  // all.
  Buffer& buffer = BufferOf(episode_id);
  for (const TracePoint& instant : instants) {
    if (instant.residuals.size() != buffer.channels ||
        instant.factors.size() != buffer.faults) {
      return false;
    }
  }
  if (!instants.empty()) {
    buffer.instants.insert(buffer.instants.end(), instants.begin(),
                           instants.end());
    buffer.dirty = true;
    buffer.ended = false;
  }
  return true;
}

void TraceWriter::End(std::uint64_t episode_id) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    found->second.ended = true;
  }
}

void TraceWriter::EndAll() {
  for (auto& [id, buffer] : buffers_) {
    buffer.ended = true;
  }
}

void TraceWriter::SetIsolated(std::uint64_t episode_id, FaultSet isolated) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    found->second.isolated = isolated;
  }
}

bool TraceWriter::HasPending() const {
  return std::any_of(buffers_.begin(), buffers_.end(), [](const auto& entry) {
    return entry.second.dirty || entry.second.ended;
  });
}

void TraceWriter::Store() {
  for (const auto& [id, buffer] : buffers_) {
    if (buffer.dirty) {
      StoreBuffer(id, buffer);
    }
  }
}

void TraceWriter::StoreBuffer(std::uint64_t episode_id, const Buffer& buffer) {
  const std::string id = EpisodeIdText(episode_id);
  std::int64_t number = buffer.chunk;
  std::span<const TracePoint> rest(buffer.instants);
  // Every commit writes the last chunk again, under its number, until it is
  // full. That costs at most kTraceChunkInstants instants per episode.
  while (!rest.empty()) {
    const auto part =
        rest.first(std::min<std::size_t>(rest.size(), kTraceChunkInstants));
    rest = rest.subspan(part.size());
    const TraceChunk chunk = EncodeTrace(part);
    database_.Cached(sql::insert_trace)
        .Bind(id, number++, part.front().sample.stamp_ns,
              part.back().sample.stamp_ns, part.size(), chunk.samples.codec,
              chunk.samples.crc, chunk.samples.bytes, chunk.vector_crc,
              chunk.vectors)
        .Run();
  }
  // The peak in the file only rises here, because the instants of full chunks
  // are no longer in the buffer.
  database_.Cached(sql::raise_peak).Bind(Peak(buffer), id).Run();
  if (database_.Changes() > 0) {
    StoreCertainty(database_, id);
  }
}

void TraceWriter::DiscardCommitted() {
  for (auto it = buffers_.begin(); it != buffers_.end();) {
    Buffer& buffer = it->second;
    // The instants of the unfinished chunk stay, to be written again together
    // with those that follow.
    const std::size_t full = buffer.instants.size() / kTraceChunkInstants;
    buffer.instants.erase(
        buffer.instants.begin(),
        buffer.instants.begin() +
            static_cast<std::ptrdiff_t>(full * kTraceChunkInstants));
    buffer.chunk += static_cast<std::int64_t>(full);
    buffer.dirty = false;
    it = buffer.ended ? buffers_.erase(it) : std::next(it);
  }
}

}  // namespace fdi::storage
