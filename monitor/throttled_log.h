#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "base/log.h"
#include "base/mutex.h"

namespace fdi::monitor {

/// Repeating log events of a monitor: the numbers are the log ids in
/// docs/troubleshooting.md, M101 and so on.
enum class LogId : std::uint8_t {
  kBadQuality = 101,     ///< sample_rejected reason=bad_quality
  kNotFinite = 102,      ///< sample_rejected reason=not_finite
  kRange = 103,          ///< sample_rejected reason=range
  kUnit = 104,           ///< sample_rejected reason=unit
  kPeriod = 105,         ///< sample_rejected reason=period
  kRepeat = 106,         ///< sample_rejected reason=repeat
  kLate = 107,           ///< sample_rejected reason=late
  kSuperseded = 108,     ///< sample_rejected reason=superseded
  kBadId = 109,          ///< sample_rejected reason=valve_id
  kValveRefused = 110,   ///< valve_refused: beyond --max-valves
  kUnassigned = 111,     ///< valve_unassigned
  kModelFailure = 112,   ///< model_set_unusable
  kGap = 113,            ///< data_gap
  kStale = 114,          ///< valve_stale
  kMissingSignal = 116,  ///< sample_rejected reason=missing_signal
  kOverShare = 117,      ///< sample_rejected reason=over_share
  kTwoPublishers = 118,  ///< two_publishers
  kPartlyJudged = 119,   ///< valve_partly_judged
  kHeld = 120,           ///< readings_held
  kUnsent = 121,         ///< publication_failed
  kUnpersisted = 122,    ///< event_unpersisted
  kPersistence = 123,    ///< persistence_degraded
  kHistoryLost = 124,    ///< history_dropped
  kRefused = 125,        ///< event_refused
  kSetAside = 126,       ///< record_set_aside
  kRecordDropped = 131,  ///< record_dropped
  kRecordFailed = 132,   ///< record_failed
  kTransport = 141,      ///< transport_loss
  kStalled = 151,        ///< threads_stalled
  kContested = 154,      ///< valves_contested
  kPartFailed = 155,     ///< part_failed
  kLookDropped = 161,    ///< second_look_dropped
  kLookFailed = 162,     ///< second_look_failed
};

/// "event id=M101 FIELDS"
std::string LogLine(LogId id, std::string_view event, std::string_view fields);

/// Bound on the lines of one kind.
struct LogLimitOptions {
  int lines{100};  ///< In each interval.
  std::chrono::milliseconds interval{10'000};
};

/// Counts lines by kind and decides which to show. It remembers 10 000 kinds
/// and shows no more of them in an interval, because others may make up their
/// names. Thread safe.
class LogLimit {
 public:
  explicit LogLimit(const LogLimitOptions& options) : options_(options) {}

  /// @param not_shown set to the number suppressed since the last shown line.
  /// @returns whether the line is to be shown.
  bool Admit(std::string_view kind, std::uint64_t& not_shown);

 private:
  struct Window {
    std::chrono::steady_clock::time_point begin;
    int shown{0};
    std::uint64_t not_shown{0};
  };

  LogLimitOptions options_;
  Mutex mutex_;
  std::map<std::string, Window, std::less<>> windows_ GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point swept_ GUARDED_BY(mutex_);
};

/// Writes lines with the ids above: the first of each id immediately, and then
/// at most one per interval, with the number suppressed (`not_shown=N`).
///
/// Thread safe.
class ThrottledLog {
 public:
  explicit ThrottledLog(LogSink sink, std::chrono::milliseconds interval =
                                          std::chrono::milliseconds(10'000))
      : sink_(std::move(sink)), limit_({1, interval}) {}

  /// @param fields is called only for a line that is written; its result
  ///   follows the event, e.g. "valve=V1 reason=range".
  void Report(LogId id, std::string_view event,
              const std::function<std::string()>& fields,
              LogLevel level = LogLevel::kWarning);

  /// Writes a line unchanged and unthrottled.
  void Line(LogLevel level, std::string_view line) const;

 private:
  LogSink sink_;
  LogLimit limit_;
};

/// Wraps `sink` and suppresses lines beyond the limit of their event, which is
/// the first word; the next line of the event that is shown carries the number
/// suppressed. Thread safe.
LogSink LimitLog(LogSink sink, const LogLimitOptions& options = {});

}  // namespace fdi::monitor
