#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>

#include "diagnosis/log.h"

namespace fdi::monitor {

/// What a monitor reports again and again: log ids of docs/errors.md.
enum class LogId : std::uint8_t {
  kBadQuality,     ///< M101 sample_rejected reason=bad_quality
  kNotFinite,      ///< M102 sample_rejected reason=not_finite
  kRange,          ///< M103 sample_rejected reason=range
  kUnit,           ///< M104 sample_rejected reason=unit
  kPeriod,         ///< M105 sample_rejected reason=period
  kRepeat,         ///< M106 sample_rejected reason=repeat
  kLate,           ///< M107 sample_rejected reason=late
  kSuperseded,     ///< M108 sample_rejected reason=superseded
  kBadId,          ///< M109 sample_rejected reason=valve_id
  kValveRefused,   ///< M110 valve_refused: beyond --max-valves
  kUnassigned,     ///< M111 valve_unassigned
  kModelFailure,   ///< M112 model_set_unusable
  kGap,            ///< M113 data_gap
  kStale,          ///< M114 valve_stale
  kShadow,         ///< M115 shadow_not_compared
  kUnsent,         ///< M121 publication_failed
  kUnpersisted,    ///< M122 event_unpersisted
  kPersistence,    ///< M123 persistence_degraded
  kHistoryLost,    ///< M124 history_dropped
  kRecordDropped,  ///< M131 record_dropped
  kRecordFailed,   ///< M132 record_failed
  kTransport,      ///< M141 transport_loss
  kStalled,        ///< M151 threads_stalled
  kCount_
};

std::string_view LogIdName(LogId id);  ///< "M101", ...

/// Writes lines `event id=M101 key=value ...`, of each id the first at once
/// and then at most one per interval, with the number of those left out.
///
/// Thread safe.
class ThrottledLog {
 public:
  using Clock = std::chrono::steady_clock;

  explicit ThrottledLog(LogSink sink, std::chrono::milliseconds interval =
                                          std::chrono::milliseconds(10'000));

  /// @param fields is called only for a line that is written; its result
  ///   follows the event, e.g. "valve=V1 reason=range".
  void Report(LogId id, std::string_view event,
              const std::function<std::string()>& fields,
              LogLevel level = LogLevel::kWarning);

  /// A line as it is, unthrottled.
  void Line(LogLevel level, std::string_view line) const;

 private:
  struct Entry {
    bool written{false};
    Clock::time_point last;
    std::uint64_t left_out{0};
  };

  LogSink sink_;
  std::chrono::milliseconds interval_;
  std::mutex mutex_;
  std::array<Entry, static_cast<std::size_t>(LogId::kCount_)> entries_;
};

}  // namespace fdi::monitor
