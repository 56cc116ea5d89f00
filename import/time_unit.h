#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace fdi::importer {

/// Form of the cells of a time column.
enum class TimeForm {
  kFindOut,
  kElapsed,  ///< A number from CsvOptions::start_ns.
  kCount,    ///< A number since an instant in UTC.
  kDays,     ///< Days of local time, as spreadsheets count.
  kDaysUtc,  ///< Days of UTC.
  kText,     ///< As ScanTime() reads it.
  kClock,    ///< Without a date, as ParseElapsed() reads it, from start_ns.
};

/// Form of a time column, and what its numbers count.
struct TimeUnit {
  TimeForm form{TimeForm::kFindOut};
  double scale{1.0};    ///< Seconds per number.
  double of_1970{0.0};  ///< 1970-01-01 in these numbers.
  bool operator==(const TimeUnit&) const = default;
};

/// The unit that a map calls `name`: "s", "unix ms", "filetime", "serial", ...
std::optional<TimeUnit> FindTimeUnit(std::string_view name);
/// Its name in a map.
std::string_view TimeUnitName(const TimeUnit& unit);
/// All names, for messages.
std::string TimeUnitNames();

/// The unit of a time column, by its name and its first cell, a number.
TimeUnit TimeUnitOf(std::string_view name, double first);

}  // namespace fdi::importer
