#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "plant/plant_database.h"
#include "storage/history/foreign_history.h"

namespace fdi::storage {

/// Reads the plant's history, over all monitors or those of one name. For an id
/// that several monitors have, Show(), Events(), Look(), Trace() and
/// AlarmList() give that of the first by host and name; for an hour of a valve,
/// Health() gives the one with the longest LIVE time.
///
/// Everybody with an account can write there, so each row is judged when it is
/// read: one that cannot be (a stamp outside the years 1900 to 2149, an unknown
/// unit or fault, a number that is not finite, damaged bytes) is left out and
/// counted for TakeNote(), and all others are shown.
class PlantReader : public ForeignHistory {
 public:
  /// @param monitor a name; empty: all. @throws PlantError as PlantDatabase.
  explicit PlantReader(const std::string& url, std::string monitor = {},
                       PlantLimits limits = {});
  ~PlantReader() override;

  std::vector<Episode> List(const EpisodeFilter& filter) override;
  Episode Show(std::string_view id) override;
  std::vector<HistoryEntry> Events(std::uint64_t episode_id) override;
  std::optional<EpisodeLook> Look(std::uint64_t episode_id) override;
  std::vector<StrengthPoint> Strengths(std::uint64_t episode_id) override;
  std::vector<TracePoint> Trace(std::uint64_t episode_id) override;
  std::vector<DataGap> Gaps(const EpisodeFilter& filter) override;
  std::vector<CoverageTime> Coverage(const EpisodeFilter& filter) override;
  std::vector<Alarm> AlarmList(std::int64_t now_ns,
                               std::int64_t limit) override;
  AlarmStatistics AlarmFigures(const EpisodeFilter& filter,
                               std::int64_t now_ns) override;
  std::vector<Shelf> Shelves(
      std::optional<std::int64_t> not_over_at_ns) override;
  std::vector<HealthHour> Health(const HealthFilter& filter) override;
  std::vector<std::string> HealthValves(const std::string& glob) override;
  std::vector<CommonCause> Causes(std::int64_t since_ns) override;
  std::string Version() override;
  void FinishWithin(std::chrono::milliseconds time) override;
  void SayTo(LogSink log) override;
  /// The valves that some monitor has seen since then, each with the last hour
  /// of which anything is stored, as its beginning [ns].
  std::map<std::string, std::int64_t> SeenValves(std::int64_t since_ns);

 private:
  template <typename Record, typename Read>
  std::vector<Record> Judged(const char* what, const PlantRows& rows,
                             const Read& read);
  template <typename Record>
  std::vector<Record> Judged(const char* what, const PlantRows& rows);
  void CountUnsound(const char* what, std::string_view sql,
                    std::string_view sound, const EpisodeFilter& filter);
  std::vector<Episode> ListWhere(const std::string& more,
                                 const EpisodeFilter& filter);
  PlantRows Query(std::string_view sql, const EpisodeFilter& filter);
  PlantRows QueryEpisode(std::string_view sql, std::uint64_t episode_id,
                         const char* order = "");

  PlantDatabase plant_;
  std::string monitor_;
  LogSink log_;
};

}  // namespace fdi::storage
