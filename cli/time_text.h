#pragma once

#include <cstdint>
#include <ctime>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fdi::cli {

/// RFC 3339 with as many of 0, 3, 6 or 9 decimals as the stamp needs:
/// "2026-11-20T14:56:11Z", or with the local offset if not `utc`.
std::string FormatTime(std::int64_t stamp_ns, bool utc);

/// What a calendar and a clock showed.
struct CivilTime {
  std::tm fields{};
  std::int64_t fraction_ns{0};
  std::optional<int> offset_s;  ///< Of local time from UTC, if it is said.
};

/// Of dates with slashes, which alone do not tell.
enum class DateOrder { kNotSaid, kDayFirst, kMonthFirst };

/// "2026-11-20T14:56:11.5+01:00", "20.11.2026 14:56:11,5", "20-Nov-2026 14:56",
/// "11/20/2026 2:56:11 PM": clock, seconds and offset may be left out.
/// @returns nothing if it is no such time.
std::optional<CivilTime> ScanTime(std::string_view text,
                                  DateOrder order = DateOrder::kNotSaid);

/// Turns what a clock on the wall showed into UTC.
class LocalClock {
 public:
  /// @param zone "Europe/Warsaw", "UTC", "+01:00"; empty: that of the machine.
  /// @throws ConfigError if there is no such zone.
  explicit LocalClock(std::string zone);

  /// Of an hour that is shown twice, in autumn, it is the first one not
  /// before `last_ns`. A time that says its offset needs no zone.
  /// @returns nothing if the clock never showed this (in spring), or beyond the
  ///   years 1900 to 2261.
  std::optional<std::int64_t> Utc(const CivilTime& time, std::int64_t last_ns);

  const std::string& zone() const { return zone_; }

 private:
  void FindOffsets(const std::tm& fields);

  std::string zone_;
  std::optional<int> fixed_s_;
  std::time_t known_{-1};       // Half an hour of the clock,
  std::vector<int> offsets_s_;  // which had these offsets.
};

/// Reads RFC 3339; "T" may be a blank, time of day and seconds may be left
/// out. Without an offset it is local time, UTC if `utc`.
/// @throws ConfigError naming the accepted forms.
std::int64_t ParseTime(std::string_view text, bool utc);

/// As ParseTime(), or a duration ("2h") before `now_ns`, or "now".
std::int64_t ParseTimeOrAgo(std::string_view text, bool utc,
                            std::int64_t now_ns);

/// "90s", "1.5h", "1h30m", "250ms", "2d", or a plain number of seconds.
/// @throws ConfigError naming the accepted units. @returns ns.
std::int64_t ParseDuration(std::string_view text);

/// For people: "0.25 s", "42 s", "3 min 05 s", "2 h 10 min", "4 d 03 h".
std::string FormatDuration(std::int64_t duration_ns);

/// UTC now [ns]: the programs' only clock of the calendar.
std::int64_t NowNs();

}  // namespace fdi::cli
