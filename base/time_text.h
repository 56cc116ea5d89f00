#pragma once

#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <string_view>

namespace date {
class time_zone;
}

namespace fdi {

/// RFC 3339 with 0, 3, 6 or 9 decimals as needed: "2026-11-20T14:56:11Z", or
/// with the local offset if not `utc`.
std::string FormatTime(std::int64_t stamp_ns, bool utc);

/// Calendar date and time of day.
struct CivilTime {
  std::tm fields{};
  std::int64_t fraction_ns{0};
  std::optional<int> offset_s;  ///< Offset of local time from UTC, if given.
};

/// Order in dates with slashes, and in those with years of two digits.
enum class DateOrder { kNotSaid, kDayFirst, kMonthFirst, kYearFirst };

/// Parses "2026-11-20T14:56:11.5+01:00", "20.11.2026 14:56:11,5", "20-Nov-2026
/// 14:56", "11/20/2026 2:56:11 PM"; time of day, seconds and offset are
/// optional. @returns nothing if the text is not a time.
std::optional<CivilTime> ScanTime(std::string_view text,
                                  DateOrder order = DateOrder::kNotSaid);

/// Converts local time to UTC. Threads may share one.
class LocalClock {
 public:
  /// @param zone "Europe/Warsaw", "UTC", "+01:00"; empty: the machine's zone.
  /// @throws ConfigError if there is no such zone.
  explicit LocalClock(std::string zone);

  /// An ambiguous time (in autumn) is resolved to the first one that is not
  /// before `last_ns`. A time with an offset needs no zone.
  /// @returns nothing for a time that does not exist (in spring), or that a
  ///   stamp cannot hold (before 1678, after 2261).
  std::optional<std::int64_t> Utc(const CivilTime& time,
                                  std::int64_t last_ns) const;

  const std::string& zone() const { return zone_; }

 private:
  /// Seconds that the clock is ahead of UTC.
  int OffsetAt(std::time_t utc_s) const;

  std::string zone_;
  std::optional<int> fixed_s_;
  const date::time_zone* rules_{nullptr};  // Null: fixed, or the machine's.
};

/// Parses RFC 3339; "T" may be a blank, time of day and seconds are optional.
/// A time without an offset is one of `clock`.
/// @throws ConfigError naming the accepted forms.
std::int64_t ParseTime(std::string_view text, const LocalClock& clock);
/// The same; without an offset it is local time, or UTC if `utc`.
std::int64_t ParseTime(std::string_view text, bool utc);

/// Parses a time, a duration ("2h") before `now_ns`, or "now".
/// @throws ConfigError naming the accepted forms.
std::int64_t ParseTimeOrAgo(std::string_view text, bool utc,
                            std::int64_t now_ns);

/// Parses "90s", "1.5h", "1h30m", "250ms", "2d", or a number of seconds.
/// @throws ConfigError naming the accepted units. @returns ns.
std::int64_t ParseDuration(std::string_view text);

/// Readable text: "0.25 s", "42 s", "3 min 05 s", "2 h 10 min", "4 d 03 h".
std::string FormatDuration(std::int64_t duration_ns);

/// Current UTC time [ns]: the programs' only wall clock.
std::int64_t NowNs();

}  // namespace fdi
