#include "storage/history/history_reader.h"

#include <iterator>
#include <limits>

#include "base/error.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/database/record.h"
#include "storage/history/episode.h"
#include "storage/history/sql.h"
#include "storage/history/trace.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr const char* kUnknown = "unknown";

bool IsExact(const EpisodeFilter& filter) {
  return filter.valve_glob.find_first_of("*?[") == std::string::npos;
}

bool HasFaultFilter(const EpisodeFilter& filter) {
  return !filter.fault.empty() && filter.fault != kUnknown;
}

bool IsOpen(EpisodeState state) {
  return state == EpisodeState::kOpen || state == EpisodeState::kDetected ||
         state == EpisodeState::kIsolated;
}

bool IsActive(EpisodeState state) {
  return state == EpisodeState::kAlarmUnacked ||
         state == EpisodeState::kAlarmAcked;
}

bool IsUnacked(EpisodeState state) {
  return state == EpisodeState::kUnacked ||
         state == EpisodeState::kAlarmReturnedUnacked;
}

std::string FaultOf(const EpisodeFilter& filter) {
  return HasFaultFilter(filter) ? FaultName(RequireFinding(filter.fault))
                                : filter.fault;
}

// A condition that always holds still mentions its parameter, here and in
// FaultCondition(): see BindFilter().
const char* ValveCondition(const EpisodeFilter& filter) {
  return filter.valve_glob == "*" ? "?1 = '*'"
         : IsExact(filter)        ? "e.valve_id = ?1"
                                  : "e.valve_id GLOB ?1";
}

std::string_view FaultCondition(const EpisodeFilter& filter) {
  return filter.fault.empty()       ? "?4 = ''"
         : filter.fault == kUnknown ? "e.fault = ?4"
                                    : sql::holds_fault;
}

// " AND ..." for the state; empty for any.
std::string StateCondition(EpisodeState state) {
  // As AlarmStateOf() says.
  constexpr const char* kActive =
      "(e.ended_ns IS NULL OR e.unconfirmed_ns IS NOT NULL) AND "
      "(e.unconfirmed_ns IS NOT NULL OR e.cleared_ns IS NULL)";
  constexpr const char* kInactive =
      "e.unconfirmed_ns IS NULL AND "
      "coalesce(e.cleared_ns, e.ended_ns) IS NOT NULL";
  constexpr const char* kReturned =
      " AND (e.cleared_ns IS NOT NULL OR (e.end_reason NOT IN "
      "('stream_ended', 'stale_timeout', 'unknown') AND NOT (e.end_reason = "
      "'superseded' AND coalesce(e.layer, '') = 'audit')))";
  constexpr const char* kAcked = " AND e.acked_by IS NOT NULL";
  constexpr const char* kUnacked = " AND e.acked_by IS NULL";
  constexpr const char* kAlarm = " AND e.notice = 0";
  std::string open = " AND e.ended_ns IS NULL";
  switch (state) {
    case EpisodeState::kAny:
      break;
    case EpisodeState::kOpen:
      return open;
    case EpisodeState::kDetected:
      return open + " AND e.isolated_ns IS NULL";
    case EpisodeState::kIsolated:
      return open + " AND e.isolated_ns IS NOT NULL";
    case EpisodeState::kClosed:
      return " AND e.ended_ns IS NOT NULL";
    case EpisodeState::kUnacked:
      return std::string(kUnacked) + kAlarm;
    case EpisodeState::kAlarmUnacked:
      return std::string(" AND ") + kActive + kUnacked + kAlarm;
    case EpisodeState::kAlarmAcked:
      return std::string(" AND ") + kActive + kAcked + kAlarm;
    case EpisodeState::kAlarmReturnedUnacked:
      return std::string(kUnacked) + " AND " + kInactive + kReturned + kAlarm;
    case EpisodeState::kAlarmNormal:
      return std::string(" AND ") + kInactive + " AND NOT (e.acked_by IS NULL" +
             kReturned + ")" + kAlarm;
    case EpisodeState::kAlarmShelved:
      return " AND " + std::string(sql::is_shelved);
    case EpisodeState::kAlarmNotice:
      return " AND e.notice <> 0";
  }
  return "";
}

// INDEXED BY is an error where the index cannot be used. The partial indexes
// can be used only if the query repeats their condition: ended_ns IS NULL for
// episode_open, kUnacked and kAlarm for episode_unacked, the first line of
// kActive for episode_active. So the states of IsOpen(), IsUnacked() and
// IsActive() must have that in StateCondition().
const char* IndexFor(const EpisodeFilter& filter) {
  return IsExact(filter)            ? "episode_by_valve"
         : filter.fault == kUnknown ? "episode_by_fault"
         : IsOpen(filter.state)     ? "episode_open"
         : IsActive(filter.state)   ? "episode_active"
         : IsUnacked(filter.state)  ? "episode_unacked"
                                    : "episode_by_time";
}

// Query for the ids, newest first.
std::string NewestIds(const EpisodeFilter& filter) {
  const std::string valve_and_state =
      std::string(ValveCondition(filter)) + StateCondition(filter.state);
  // episode_fault repeats detected_ns, so that the episodes of a fault can be
  // walked by time, too.
  if (HasFaultFilter(filter) && !IsExact(filter)) {
    return std::string(sql::newest_of_fault) + " " + valve_and_state +
           " ORDER BY f.detected_ns DESC, e.valve_id DESC";
  }
  return std::string("SELECT e.episode_id FROM episode e INDEXED BY ") +
         IndexFor(filter) + " WHERE " + ConditionOf(filter).sql +
         " ORDER BY e.detected_ns DESC, e.valve_id DESC";
}

// SQLite rejects a value for a parameter that the text does not contain: ?5 is
// bound only where it occurs, or where ?6 follows it.
std::vector<Episode> ReadEpisodes(Statement& rows) {
  auto episodes = ReadRecords<Episode>(rows);
  for (Episode& episode : episodes) {
    episode.id = ParseEpisodeId(episode.episode_id).value_or(0);
  }
  return episodes;
}

}  // namespace

EpisodeCondition ConditionOf(const EpisodeFilter& filter) {
  return {std::string("e.detected_ns >= ?2 AND e.detected_ns < ?3 AND ") +
              ValveCondition(filter) + StateCondition(filter.state) + " AND " +
              std::string(FaultCondition(filter)),
          FaultOf(filter)};
}

// With an open end the list also has episodes that arrived since the beginning
// and are stamped far off: the clock of a publisher may be wrong by years.
//
// The inner query walks an index, newest first, and stops at the limit; only
// these episodes are read as a whole and put in order of time.
std::string ListQuery(const EpisodeFilter& filter) {
  std::string ids = NewestIds(filter) + " LIMIT ?6";
  if (filter.since_ns != std::numeric_limits<std::int64_t>::min() &&
      filter.until_ns == std::numeric_limits<std::int64_t>::max()) {
    ids = "SELECT episode_id FROM (" + ids +
          ") UNION SELECT episode_id FROM (" + std::string(sql::arrived) + " " +
          ValveCondition(filter) + StateCondition(filter.state) + " AND " +
          std::string(FaultCondition(filter)) +
          " ORDER BY v.event_id DESC LIMIT ?6)";
  }
  return std::string(sql::episodes) + " e.episode_id IN (" + ids +
         ") ORDER BY e.detected_ns, e.valve_id";
}

std::string AlarmSpanQuery(const EpisodeFilter& filter) {
  return std::string(sql::alarm_spans) + " " + ValveCondition(filter) +
         " AND " + std::string(FaultCondition(filter)) +
         " ORDER BY e.detected_ns, e.valve_id";
}

std::string AlarmListQuery() {
  return std::string(sql::episodes) + " " + std::string(sql::alarm_list);
}

std::vector<AlarmSpan> ReadAlarmSpans(Database& database,
                                      const EpisodeFilter& filter) {
  Statement rows = database.Prepare(AlarmSpanQuery(filter));
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
            FaultOf(filter));
  return ReadRecords<AlarmSpan>(rows);
}

HistoryReader::HistoryReader(const std::filesystem::path& path)
    : database_(path, HistorySchema(), Access::kReader) {}

std::vector<Episode> HistoryReader::List(const EpisodeFilter& filter) {
  Statement rows = database_.Prepare(ListQuery(filter));
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
            FaultOf(filter), filter.now_ns,
            filter.limit > 0 ? filter.limit : -1);
  return ReadEpisodes(rows);
}

Episode HistoryReader::Show(std::string_view id) {
  const Snapshot snapshot(database_);
  const std::uint64_t episode_id = ResolveEpisode(database_, id);
  Statement rows =
      database_.Prepare(std::string(sql::episodes) + " e.episode_id = ?");
  rows.Bind(EpisodeIdText(episode_id));
  return ReadEpisodes(rows).at(0);
}

std::vector<HistoryEntry> HistoryReader::Events(std::uint64_t episode_id) {
  Statement rows = database_.Prepare(SelectSql<HistoryEntry>(
      "FROM episode_event WHERE episode_id = ? ORDER BY event_id"));
  rows.Bind(EpisodeIdText(episode_id));
  auto events = ReadRecords<HistoryEntry>(rows);
  for (HistoryEntry& event : events) {
    event.episode_id = episode_id;
  }
  return events;
}

std::vector<TracePoint> HistoryReader::Trace(std::uint64_t episode_id) {
  const std::string id = EpisodeIdText(episode_id);
  Statement row = database_.Prepare(sql::trace_chunks);
  row.Bind(id);
  std::vector<TracePoint> trace;
  while (row.Step()) {
    TraceChunk chunk;
    std::string number;
    row.Read(0, chunk.samples.codec, chunk.samples.crc, chunk.samples.count,
             chunk.samples.bytes, chunk.vector_crc, chunk.vectors, number);
    auto part = DecodeTrace(chunk, database_.path().string() + ": trace of " +
                                       id + ", chunk " + number);
    trace.insert(trace.end(), std::make_move_iterator(part.begin()),
                 std::make_move_iterator(part.end()));
  }
  return trace;
}

std::vector<DataGap> HistoryReader::Gaps(const EpisodeFilter& filter) {
  Statement rows = database_.Prepare(sql::gaps);
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns);
  return ReadRecords<DataGap>(rows);
}

std::vector<CoverageTime> HistoryReader::Coverage(const EpisodeFilter& filter) {
  // Coverage is stored by day: a day that is only partly in the window counts
  // as a whole.
  Statement rows = database_.Prepare(sql::coverage);
  rows.Bind(filter.valve_glob, filter.since_ns / kNsPerDay, filter.until_ns);
  return ReadRecords<CoverageTime>(rows);
}

std::vector<MonitorSession> HistoryReader::Sessions() {
  Statement rows = database_.Prepare(
      SelectSql<MonitorSession>("FROM monitor_session ORDER BY session_id"));
  return ReadRecords<MonitorSession>(rows);
}

std::vector<Alarm> HistoryReader::AlarmList(std::int64_t now_ns,
                                            std::int64_t limit) {
  const Snapshot snapshot(database_);
  Statement rows = database_.Prepare(AlarmListQuery());
  rows.Bind(limit);
  return Alarms(ReadEpisodes(rows), now_ns);
}

AlarmCounts HistoryReader::CountAlarms(std::int64_t now_ns) {
  const Snapshot snapshot(database_);
  AlarmCounts counts;
  for (const std::string_view part : {sql::count_active, sql::count_returned}) {
    Statement rows = database_.Prepare(std::string(part) + " AND NOT " +
                                       std::string(sql::is_shelved) +
                                       " GROUP BY e.priority");
    rows.Bind(std::nullopt, std::nullopt, std::nullopt, std::nullopt, now_ns);
    while (rows.Step()) {
      const Severity severity =
          SeverityOf(rows.Int64(0)).value_or(Severity::kMedium);
      const auto i = static_cast<std::size_t>(severity);
      counts.active[i] += static_cast<std::uint64_t>(rows.Int64(1));
      counts.unacked[i] += static_cast<std::uint64_t>(rows.Int64(2));
    }
  }
  return counts;
}

std::vector<std::uint64_t> HistoryReader::Over(
    const std::vector<std::uint64_t>& episodes) {
  const Snapshot snapshot(database_);
  std::vector<std::uint64_t> over;
  for (const std::uint64_t episode : episodes) {
    Statement row = database_.Prepare(sql::is_over);
    if (row.Bind(EpisodeIdText(episode)).Step()) {
      over.push_back(episode);
    }
  }
  return over;
}

AlarmStatistics HistoryReader::AlarmFigures(const EpisodeFilter& filter,
                                            std::int64_t now_ns) {
  return ComputeAlarmStatistics(ReadAlarmSpans(database_, filter),
                                filter.since_ns, filter.until_ns, now_ns);
}

std::vector<Shelf> HistoryReader::Shelves(
    std::optional<std::int64_t> not_over_at_ns) {
  return ReadShelves(database_, not_over_at_ns);
}

std::vector<CommonCause> HistoryReader::Causes(std::int64_t since_ns) {
  const Snapshot snapshot(database_);
  return ReadCommonCauses(database_, since_ns);
}

std::vector<HealthHour> HistoryReader::Health(const HealthFilter& filter) {
  return ReadHealth(database_, filter);
}

std::vector<std::string> HistoryReader::HealthValves(const std::string& glob) {
  return storage::HealthValves(database_, glob);
}

// data_version changes when another connection commits.
std::string HistoryReader::Version() {
  reopened_ += database_.Refresh() ? 1 : 0;
  return std::to_string(reopened_) + '.' +
         std::to_string(database_.DataVersion());
}

}  // namespace fdi::storage
