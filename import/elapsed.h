#pragma once

#include <optional>
#include <string_view>

namespace fdi::importer {

/// A time without a date.
struct ElapsedTime {
  double seconds{0.0};
  /// It begins again at zero after so many seconds: at midnight, or, of minutes
  /// and seconds, with the hour. 0: never.
  double wraps_s{86400.0};
};

/// Parses "14:56", "14:56:11.5", "2:56:11 PM", "26:03:00", "0 days 00:00:01",
/// "03:59.0" (minutes and seconds, as spreadsheets write them) and "12 sec".
/// @returns nothing for other text, dates and plain numbers.
std::optional<ElapsedTime> ParseElapsed(std::string_view text);

}  // namespace fdi::importer
