#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/database/database.h"
#include "storage/history/history.h"
#include "storage/history/history_database.h"

namespace fdi::storage {

/// Reads history.db beside a running monitor.
class HistoryReader : public History {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit HistoryReader(const std::filesystem::path& path);

  std::vector<Episode> List(const EpisodeFilter& filter = {}) override;
  Episode Show(std::string_view id) override;
  std::vector<HistoryEntry> Events(std::uint64_t episode_id) override;
  std::optional<EpisodeLook> Look(std::uint64_t episode_id) override;
  std::vector<StrengthPoint> Strengths(std::uint64_t episode_id) override;
  std::vector<TracePoint> Trace(std::uint64_t episode_id) override;
  std::vector<DataGap> Gaps(const EpisodeFilter& filter = {}) override;
  std::vector<CoverageTime> Coverage(const EpisodeFilter& filter = {}) override;
  std::vector<Alarm> AlarmList(std::int64_t now_ns,
                               std::int64_t limit = 500) override;
  AlarmCounts CountAlarms(std::int64_t now_ns);
  /// Those of `episodes` that have ended and that no longer wait for a
  /// confirmation.
  std::vector<std::uint64_t> Over(const std::vector<std::uint64_t>& episodes);
  AlarmStatistics AlarmFigures(const EpisodeFilter& filter,
                               std::int64_t now_ns) override;
  std::vector<Shelf> Shelves(
      std::optional<std::int64_t> not_over_at_ns = {}) override;
  std::vector<HealthHour> Health(const HealthFilter& filter) override;
  std::vector<std::string> HealthValves(const std::string& glob) override;
  std::vector<CommonCause> Causes(std::int64_t since_ns) override;
  /// Opens the file of this name again if it was deleted or replaced.
  std::string Version() override;

  std::vector<MonitorSession> Sessions();
  Database& database() { return database_; }

 private:
  Database database_;
  int reopened_{0};
};

/// The episodes of the filter's valves and fault that overlap its time, ordered
/// by detection; its state and limit are ignored.
/// @throws ConfigError for an unknown fault.
std::vector<AlarmSpan> ReadAlarmSpans(Database& database,
                                      const EpisodeFilter& filter);

/// The SQL condition for a filter over `episode e`, valid for SQLite and,
/// except for parameter markers and GLOB, for PostgreSQL.
struct EpisodeCondition {
  std::string sql;    ///< Parameters ?1 valve, ?2 since, ?3 until, ?4, ?5 now.
  std::string fault;  ///< The value of ?4.
};
EpisodeCondition ConditionOf(const EpisodeFilter& filter);

// The underlying queries, whose plans are tested. Parameters, as far as they
// occur: ?1 valve, ?2 since, ?3 until, ?4 fault, ?5 now, ?6 limit.

/// SQL for kFieldsOf<Episode> of the newest `limit` episodes of `filter`,
/// oldest first. Each filter scans an index of its own, newest first, so that a
/// limit ends the scan early; the most selective condition chooses it: valve
/// id, fault, open, unacknowledged, time.
std::string ListQuery(const EpisodeFilter& filter);

/// SQL for the columns of AlarmSpan, ordered by detection, from a covering
/// index: the episodes that overlap the filter's time.
std::string AlarmSpanQuery(const EpisodeFilter& filter);

/// SQL for kFieldsOf<Episode> of open and of ended unacknowledged episodes,
/// newest first; at most ?1, of which open ones take precedence.
std::string AlarmListQuery();

}  // namespace fdi::storage
