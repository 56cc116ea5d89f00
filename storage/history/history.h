#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "diagnosis/records/trace_point.h"
#include "storage/history/alarm.h"
#include "storage/history/episode.h"
#include "storage/history/health.h"

namespace fdi::storage {

/// Reads what happened: to the valves of one monitor (HistoryReader), or of a
/// plant (PlantReader), whose rows have their host and monitor. One thread at a
/// time.
class History {
 public:
  virtual ~History() = default;

  /// By detection.
  virtual std::vector<Episode> List(const EpisodeFilter& filter) = 0;

  /// `id` may be a unique beginning, or `last`.
  /// @throws NotFoundError if no episode, or more than one, begins like that.
  virtual Episode Show(std::string_view id) = 0;

  /// Of one episode, in order of recording.
  virtual std::vector<HistoryEntry> Events(std::uint64_t episode_id) = 0;

  /// Nothing if no second look at the episode had an answer.
  /// @throws DataError
  virtual std::optional<EpisodeLook> Look(std::uint64_t episode_id) = 0;

  /// How strong the faults of an episode were, by stamp. @throws DataError
  virtual std::vector<StrengthPoint> Strengths(std::uint64_t episode_id) = 0;

  /// In order of arrival. @throws DataError if stored bytes are damaged.
  virtual std::vector<TracePoint> Trace(std::uint64_t episode_id) = 0;

  /// By valve and fault, of the episodes that List() would give.
  virtual std::vector<EpisodeStatistics> Statistics(
      const EpisodeFilter& filter) = 0;

  /// Gaps that touch the filter's time, of its valves and of all valves.
  virtual std::vector<DataGap> Gaps(const EpisodeFilter& filter) = 0;

  /// Time by valve and quality; the filter's fault and state do not count.
  virtual std::vector<CoverageTime> Coverage(const EpisodeFilter& filter) = 0;

  /// Open episodes, and ended ones that nobody has acknowledged, newest first:
  /// `limit` of them, open ones before others. Shelved ones are among them.
  virtual std::vector<Alarm> AlarmList(std::int64_t now_ns,
                                       std::int64_t limit) = 0;

  /// ComputeAlarmStatistics() of the filter's valves, fault and time.
  virtual AlarmStatistics AlarmFigures(const EpisodeFilter& filter,
                                       std::int64_t now_ns) = 0;

  /// By beginning: those in force at a time, or all there ever were.
  virtual std::vector<Shelf> Shelves(
      std::optional<std::int64_t> in_force_at_ns) = 0;

  /// The hours of one valve that begin in the window, by time.
  virtual std::vector<HealthHour> Health(const HealthFilter& filter) = 0;
  /// Valves that have any, by id; `glob` as in a shell.
  virtual std::vector<std::string> HealthValves(const std::string& glob) = 0;

  /// Differs once something was stored since the last call of this reader.
  virtual std::string Version() = 0;

  /// `episodes` with what is shelved now.
  std::vector<Alarm> Alarms(std::vector<Episode> episodes,
                            std::int64_t now_ns) {
    return AsAlarms(std::move(episodes), Shelves(now_ns), now_ns);
  }
};

}  // namespace fdi::storage
