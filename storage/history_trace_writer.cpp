#include "storage/history_trace_writer.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "diagnosis/error.h"
#include "storage/history_rows.h"
#include "storage/history_trace.h"

namespace fdi::storage {

Statement& StatementCache::operator()(const char* sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) {
    found = statements_.emplace(sql, database_.Prepare(sql)).first;
  }
  return found->second;
}

// Largest factor of the isolated set; before isolation, of any fault.
double HistoryTraceWriter::Peak(const Buffer& buffer) {
  double peak = 0.0;
  for (const TraceInstant& instant : buffer.instants) {
    if (instant.received.sample.stamp_ns < buffer.detected_ns ||
        instant.isolated != buffer.isolated) {
      continue;
    }
    for (std::size_t f = 0; f < instant.fault_factors.size(); ++f) {
      if (buffer.isolated == 0 || (buffer.isolated >> f & 1U) != 0) {
        // A NaN compares false: it does not count.
        peak = std::max(peak, instant.fault_factors[f]);
      }
    }
  }
  return peak;
}

HistoryTraceWriter::Buffer& HistoryTraceWriter::BufferOf(
    std::uint64_t episode_id) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    return found->second;
  }
  const std::string id = EpisodeIdText(episode_id);
  Statement row = database_.Prepare(
      "SELECT channels, faults, fault_bits, detected_ns, (SELECT count(*) FROM "
      "episode_trace t WHERE t.episode_id = e.episode_id) FROM episode e "
      "WHERE episode_id = ?");
  if (!row.Bind(id).Step()) {
    throw NotFoundError("no episode " + id);
  }
  Buffer buffer;
  buffer.channels = SplitNames(row.Text(0)).size();
  buffer.faults = SplitNames(row.Text(1)).size();
  buffer.isolated = row.Uint64(2);
  buffer.detected_ns = row.Int64(3);
  buffer.chunk = row.Int64(4);
  return buffers_.emplace(episode_id, std::move(buffer)).first->second;
}

bool HistoryTraceWriter::Append(std::uint64_t episode_id,
                                std::span<const TraceInstant> instants) {
  Buffer& buffer = BufferOf(episode_id);
  for (const TraceInstant& instant : instants) {
    if (instant.residuals.size() != buffer.channels ||
        instant.fault_factors.size() != buffer.faults) {
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

void HistoryTraceWriter::End(std::uint64_t episode_id) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    found->second.ended = true;
  }
}

void HistoryTraceWriter::EndAll() {
  for (auto& [id, buffer] : buffers_) {
    buffer.ended = true;
  }
}

void HistoryTraceWriter::SetIsolated(std::uint64_t episode_id,
                                     FaultSet isolated) {
  const auto found = buffers_.find(episode_id);
  if (found != buffers_.end()) {
    found->second.isolated = isolated;
  }
}

bool HistoryTraceWriter::HasPending() const {
  return std::any_of(buffers_.begin(), buffers_.end(), [](const auto& entry) {
    return entry.second.dirty || entry.second.ended;
  });
}

void HistoryTraceWriter::Store() {
  for (const auto& [id, buffer] : buffers_) {
    if (buffer.dirty) {
      StoreBuffer(id, buffer);
    }
  }
}

void HistoryTraceWriter::StoreBuffer(std::uint64_t episode_id,
                                     const Buffer& buffer) {
  const std::string id = EpisodeIdText(episode_id);
  std::int64_t number = buffer.chunk;
  std::span<const TraceInstant> rest(buffer.instants);
  while (!rest.empty()) {
    const auto part =
        rest.first(std::min<std::size_t>(rest.size(), kTraceChunkInstants));
    rest = rest.subspan(part.size());
    const TraceChunk chunk = EncodeTrace(part);
    statements_(
        "INSERT INTO episode_trace (episode_id, chunk, first_ns, last_ns, "
        "instants, sample_codec, sample_crc, samples, vector_crc, vectors) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
        "ON CONFLICT (episode_id, chunk) DO UPDATE SET "
        "last_ns = excluded.last_ns, instants = excluded.instants, "
        "sample_codec = excluded.sample_codec, "
        "sample_crc = excluded.sample_crc, samples = excluded.samples, "
        "vector_crc = excluded.vector_crc, vectors = excluded.vectors")
        .Bind(id, number++, part.front().received.sample.stamp_ns,
              part.back().received.sample.stamp_ns, part.size(),
              chunk.samples.codec, chunk.samples.crc, chunk.samples.bytes,
              chunk.vector_crc, chunk.vectors)
        .Run();
  }
  statements_(
      "UPDATE episode SET peak_factor = max(peak_factor, ?1) "
      "WHERE episode_id = ?2 AND peak_factor < ?1")
      .Bind(Peak(buffer), id)
      .Run();
}

void HistoryTraceWriter::Settle() {
  for (auto it = buffers_.begin(); it != buffers_.end();) {
    Buffer& buffer = it->second;
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
