#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "diagnosis/records/episode_look.h"
#include "diagnosis/records/service_records.h"
#include "diagnosis/records/strength_point.h"
#include "diagnosis/records/trace_point.h"
#include "storage/history/alarm.h"
#include "storage/history/common_cause.h"
#include "storage/history/episode.h"
#include "storage/history/health.h"

namespace fdi::storage {

/// A history on another host is out of reach, refuses or fails; what() is one
/// line with its reason.
class HistoryAwayError : public DataError {
 public:
  using DataError::DataError;
};

/// Read access to the history of one monitor (HistoryReader), or of a plant,
/// whose rows also have host and monitor. One thread at a time.
class History {
 public:
  virtual ~History() = default;

  /// Ordered by detection.
  virtual std::vector<Episode> List(const EpisodeFilter& filter) = 0;

  /// `id` may be a unique prefix, or `last`.
  /// @throws NotFoundError if no episode, or more than one, matches.
  virtual Episode Show(std::string_view id) = 0;

  /// Entries of one episode, in order of recording.
  virtual std::vector<HistoryEntry> Events(std::uint64_t episode_id) = 0;

  /// The result of the second look at the episode; nothing if there is none.
  /// @throws DataError
  virtual std::optional<EpisodeLook> Look(std::uint64_t episode_id) = 0;

  /// The strengths of the faults of an episode, by stamp. @throws DataError
  virtual std::vector<StrengthPoint> Strengths(std::uint64_t episode_id) = 0;

  /// In order of arrival. @throws DataError if stored bytes are damaged.
  virtual std::vector<TracePoint> Trace(std::uint64_t episode_id) = 0;

  /// Gaps that overlap the filter's time, of its valves and of all valves.
  virtual std::vector<DataGap> Gaps(const EpisodeFilter& filter) = 0;

  /// Time by valve and quality; the filter's fault and state are ignored.
  virtual std::vector<CoverageTime> Coverage(const EpisodeFilter& filter) = 0;

  /// Open episodes and ended unacknowledged ones, newest first, including
  /// shelved ones; at most `limit`, of which open ones take precedence.
  virtual std::vector<Alarm> AlarmList(std::int64_t now_ns,
                                       std::int64_t limit) = 0;

  /// ComputeAlarmStatistics() for the filter's valves, fault and time.
  virtual AlarmStatistics AlarmFigures(const EpisodeFilter& filter,
                                       std::int64_t now_ns) = 0;

  /// As ReadShelves().
  virtual std::vector<Shelf> Shelves(
      std::optional<std::int64_t> not_over_at_ns) = 0;

  /// The hours of one valve that begin in the window, ordered by time.
  virtual std::vector<HealthHour> Health(const HealthFilter& filter) = 0;
  /// Ids of valves that have stored hours, sorted; `glob` is a shell pattern.
  virtual std::vector<std::string> HealthValves(const std::string& glob) = 0;

  /// Common causes that have not ended, however old, and those that opened
  /// since then; ordered by opening.
  virtual std::vector<CommonCause> Causes(std::int64_t since_ns) = 0;
  std::vector<CommonCause> OpenCauses() {
    return Causes(std::numeric_limits<std::int64_t>::max());
  }

  /// Changes whenever something was stored since the last call on this object.
  virtual std::string Version() = 0;

  /// `episodes` with the shelves that are in force.
  std::vector<Alarm> Alarms(std::vector<Episode> episodes,
                            std::int64_t now_ns) {
    return AsAlarms(std::move(episodes), Shelves(now_ns), now_ns);
  }
};

}  // namespace fdi::storage
