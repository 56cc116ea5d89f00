#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/alarm.h"
#include "storage/alarm_statistics.h"
#include "storage/database.h"
#include "storage/history_coverage.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// Reads history.db beside a running monitor. One thread at a time.
class HistoryReader {
 public:
  /// @throws DataError, SqliteError as Database.
  explicit HistoryReader(const std::filesystem::path& path);

  /// By detection.
  std::vector<Episode> List(const EpisodeFilter& filter = {});

  /// `id` may be a unique beginning, or `last`.
  /// @throws NotFoundError if no episode, or more than one, begins like that.
  Episode Show(std::string_view id);

  /// Of one episode, in order of recording.
  std::vector<EpisodeEvent> Events(std::uint64_t episode_id);

  /// In order of arrival. @throws DataError if stored bytes are damaged.
  std::vector<TraceInstant> Trace(std::uint64_t episode_id);

  /// By valve and fault, of the episodes that List() would give.
  std::vector<EpisodeStatistics> Statistics(const EpisodeFilter& filter = {});

  /// Gaps that touch the filter's time, of its valves and of all valves.
  std::vector<DataGap> Gaps(const EpisodeFilter& filter = {});
  std::vector<MonitorSession> Sessions();

  /// Time by valve and quality; the filter's fault and state do not count.
  std::vector<CoverageTime> Coverage(const EpisodeFilter& filter = {});

  /// Open episodes, and ended ones that nobody has acknowledged, newest first:
  /// `limit` of them, open ones before others. Shelved ones are among them.
  std::vector<Alarm> AlarmList(std::int64_t now_ns, std::int64_t limit = 500);
  /// `episodes` with what is shelved now.
  std::vector<Alarm> Alarms(std::vector<Episode> episodes, std::int64_t now_ns);

  /// ComputeAlarmStatistics() of the filter's valves, fault and time.
  AlarmStatistics AlarmFigures(const EpisodeFilter& filter, std::int64_t now_ns,
                               const AlarmCriteria& criteria = {});

  /// By beginning: those in force at a time, or all there ever were.
  std::vector<Shelf> Shelves(std::optional<std::int64_t> in_force_at_ns = {});

  Database& database() { return database_; }

 private:
  Database database_;
};

}  // namespace fdi::storage
