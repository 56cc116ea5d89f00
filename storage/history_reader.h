#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

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

  Database& database() { return database_; }

 private:
  Database database_;
};

/// Acknowledges and labels beside a running monitor, as an occasional writer.
/// Every change is also an event of the episode.
class HistoryEditor {
 public:
  explicit HistoryEditor(const std::filesystem::path& path);

  /// @throws NotFoundError as HistoryReader::Show().
  void Acknowledge(std::string_view id, std::string_view who,
                   std::string_view comment, std::int64_t now_ns);

  /// @param label true (the answer was right), false (there was no fault), or
  ///   the name of the fault that it was.
  /// @throws ConfigError for another label; NotFoundError.
  void Label(std::string_view id, std::string_view label, std::string_view who,
             std::string_view comment, std::int64_t now_ns);

 private:
  Database database_;
};

}  // namespace fdi::storage
