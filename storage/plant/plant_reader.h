#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/service_records.h"
#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/plant/plant_database.h"

namespace fdi::storage {

/// Reads the plant's history as HistoryReader reads one monitor's: the
/// functions of the same name give the same, over all monitors or those of one
/// name. Episodes have their host and monitor.
class PlantReader {
 public:
  /// @param monitor a name; empty: all. @throws PlantError as PlantDatabase.
  PlantReader(const std::string& url, std::string monitor);

  std::vector<Episode> List(const EpisodeFilter& filter = {});
  /// Of an id that several monitors have, that of the first by host and name;
  /// so do the next three.
  Episode Show(std::string_view id);
  std::vector<HistoryEntry> Events(std::uint64_t episode_id);
  std::optional<EpisodeLook> Look(std::uint64_t episode_id);
  /// Instants of evidence. What is in them is not read here.
  std::int64_t TraceInstants(std::uint64_t episode_id);
  std::vector<EpisodeStatistics> Statistics(const EpisodeFilter& filter = {});
  std::vector<DataGap> Gaps(const EpisodeFilter& filter = {});
  std::vector<CoverageTime> Coverage(const EpisodeFilter& filter = {});
  std::vector<Alarm> Alarms(std::vector<Episode> episodes, std::int64_t now_ns);
  AlarmStatistics AlarmFigures(const EpisodeFilter& filter,
                               std::int64_t now_ns);

 private:
  std::vector<Episode> ListWhere(const std::string& more,
                                 const EpisodeFilter& filter);
  PlantRows Ask(std::string_view sql, const EpisodeFilter& filter);
  PlantRows AskOf(std::string_view sql, std::uint64_t episode_id,
                  const char* order = "");

  PlantDatabase plant_;
  std::string monitor_;
};

}  // namespace fdi::storage
