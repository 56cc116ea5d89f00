#include "storage/history_reader.h"

#include "diagnosis/error.h"
#include "storage/history_query.h"
#include "storage/history_rows.h"
#include "storage/history_schema.h"
#include "storage/history_shelf.h"
#include "storage/history_trace.h"

namespace fdi::storage {
namespace {

TraceChunk ReadChunk(const Statement& row) {
  TraceChunk chunk;
  chunk.samples.codec = static_cast<ChunkCodec>(row.Int(0));
  chunk.samples.crc = static_cast<std::uint32_t>(row.Int64(1));
  chunk.samples.count = static_cast<std::uint32_t>(row.Int64(2));
  chunk.samples.bytes = row.Blob(3);
  chunk.vector_crc = static_cast<std::uint32_t>(row.Int64(4));
  chunk.vectors = row.Blob(5);
  return chunk;
}

}  // namespace

HistoryReader::HistoryReader(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kReader) {}

std::vector<Episode> HistoryReader::List(const EpisodeFilter& filter) {
  Statement row = database_.Prepare(ListQuery(filter));
  BindListQuery(row, filter);
  std::vector<Episode> episodes;
  while (row.Step()) {
    episodes.push_back(ReadEpisode(row));
  }
  return episodes;
}

Episode HistoryReader::Show(std::string_view id) {
  const Snapshot snapshot(database_);
  const std::uint64_t episode_id = ResolveEpisode(database_, id);
  Statement row = database_.Prepare(
      std::string("SELECT ") + kEpisodeColumns +
      " FROM episode e CROSS JOIN fault_history v USING (episode_id) "
      "WHERE e.episode_id = ?");
  row.Bind(EpisodeIdText(episode_id)).Step();
  return ReadEpisode(row);
}

std::vector<EpisodeEvent> HistoryReader::Events(std::uint64_t episode_id) {
  Statement row = database_.Prepare(
      "SELECT event_id, kind, stamp_ns, recorded_ns, faults, fault_bits, "
      "coalesce(factor, 0.0), coalesce(strength, 0.0), reason, value, who, "
      "comment, origin FROM episode_event WHERE episode_id = ? ORDER BY "
      "event_id");
  row.Bind(EpisodeIdText(episode_id));
  std::vector<EpisodeEvent> events;
  while (row.Step()) {
    events.push_back({row.Int64(0), episode_id, row.Text(1), row.Int64(2),
                      row.Int64(3), row.Text(4), row.Uint64(5), row.Double(6),
                      row.Double(7), row.Text(8), row.Text(9), row.Text(10),
                      row.Text(11), row.Text(12)});
  }
  return events;
}

std::vector<TraceInstant> HistoryReader::Trace(std::uint64_t episode_id) {
  const std::string id = EpisodeIdText(episode_id);
  Statement row = database_.Prepare(
      "SELECT sample_codec, sample_crc, instants, samples, vector_crc, "
      "vectors, chunk FROM episode_trace WHERE episode_id = ? ORDER BY chunk");
  row.Bind(id);
  std::vector<TraceInstant> trace;
  while (row.Step()) {
    const std::string where = database_.path().string() + ": trace of " + id +
                              ", chunk " + row.Text(6);
    auto part = DecodeTrace(ReadChunk(row), where);
    trace.insert(trace.end(), std::make_move_iterator(part.begin()),
                 std::make_move_iterator(part.end()));
  }
  return trace;
}

std::vector<EpisodeStatistics> HistoryReader::Statistics(
    const EpisodeFilter& filter) {
  Statement row = database_.Prepare(StatisticsQuery(filter));
  BindStatisticsQuery(row, filter);
  std::vector<EpisodeStatistics> statistics;
  while (row.Step()) {
    statistics.push_back({row.Text(0), row.Text(1), row.Int64(2), row.Int64(3),
                          row.Int64(4), row.Int64(5), row.Int64(6),
                          row.OptionalDouble(7), row.OptionalDouble(8),
                          row.Double(9), row.Int64(10)});
  }
  return statistics;
}

std::vector<DataGap> HistoryReader::Gaps(const EpisodeFilter& filter) {
  Statement row = database_.Prepare(
      "SELECT valve_id, from_ns, to_ns, reason FROM data_gap "
      "WHERE (valve_id IS NULL OR valve_id GLOB ?) AND to_ns >= ? AND "
      "from_ns < ? ORDER BY from_ns, valve_id");
  row.Bind(filter.valve_glob, filter.since_ns, filter.until_ns);
  std::vector<DataGap> gaps;
  while (row.Step()) {
    gaps.push_back({row.Text(0), row.Int64(1), row.Int64(2), row.Text(3)});
  }
  return gaps;
}

std::vector<CoverageTime> HistoryReader::Coverage(const EpisodeFilter& filter) {
  return ReadCoverage(database_, filter);
}

std::vector<MonitorSession> HistoryReader::Sessions() {
  Statement row = database_.Prepare(
      "SELECT session_id, start_ns, alive_ns, stop_ns, coalesce(clean, 0), "
      "software, config FROM monitor_session ORDER BY session_id");
  std::vector<MonitorSession> sessions;
  while (row.Step()) {
    sessions.push_back({row.Int64(0), row.Int64(1), row.Int64(2),
                        row.OptionalInt64(3), row.Bool(4), row.Text(5),
                        row.Text(6)});
  }
  return sessions;
}

std::vector<Alarm> HistoryReader::AlarmList(std::int64_t now_ns,
                                            std::int64_t limit) {
  const Snapshot snapshot(database_);
  Statement row = database_.Prepare(AlarmListQuery());
  row.Bind(limit);
  std::vector<Episode> episodes;
  while (row.Step()) {
    episodes.push_back(ReadEpisode(row));
  }
  return Alarms(std::move(episodes), now_ns);
}

std::vector<Alarm> HistoryReader::Alarms(std::vector<Episode> episodes,
                                         std::int64_t now_ns) {
  return AsAlarms(std::move(episodes), Shelves(now_ns), now_ns);
}

AlarmStatistics HistoryReader::AlarmFigures(const EpisodeFilter& filter,
                                            std::int64_t now_ns,
                                            const AlarmCriteria& criteria) {
  return ComputeAlarmStatistics(ReadAlarmSpans(database_, filter),
                                filter.since_ns, filter.until_ns, now_ns,
                                criteria);
}

std::vector<Shelf> HistoryReader::Shelves(
    std::optional<std::int64_t> in_force_at_ns) {
  return ReadShelves(database_, in_force_at_ns);
}

}  // namespace fdi::storage
