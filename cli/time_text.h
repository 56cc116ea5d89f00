#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace fdi::cli {

/// RFC 3339 with as many of 0, 3, 6 or 9 decimals as the stamp needs:
/// "2026-11-20T14:56:11Z", or with the local offset if not `utc`.
std::string FormatTime(std::int64_t stamp_ns, bool utc);

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
