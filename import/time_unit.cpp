#include "import/time_unit.h"

#include <algorithm>
#include <cmath>

#include "base/csv_cells.h"
#include "base/text.h"
#include "import/csv.h"
#include "import/quality.h"

namespace fdi::importer {
namespace {

constexpr double kDay = 86400.0;

/// A unit of time, and the first cells by which it is recognised.
struct TimeRow {
  std::string_view name;  ///< In a map.
  TimeUnit unit;
  double low{0.0};       ///< Cells between are of this unit. Both 0: the name
  double high{0.0};      ///< of the column ends in the unit, as in "Time [ms]".
  bool fraction{false};  ///< Only with a fraction: a whole number of days is
                         ///< rather a count of seconds than a midnight.
  std::string_view words{};  ///< In the name of the column, instead of that.
};

// The first row that fits counts. 6e8 to 4e9 s since 1970 are 1989 to 2096, and
// 3.5e9 to 4.3e9 s since 1904 are 2014 to 2040: nobody has readings of 2080
// yet, so these come first. The others: 1987 to 2107 in 100 ns since 1601, 1965
// to 2124 since year 1, 1968 to 2132 in Julian days, 1982 to 2091 in those of a
// spreadsheet, 1971 to 2108 in those of MATLAB.
constexpr TimeRow kTimeRows[] = {
    {"filetime", {TimeForm::kCount, 1e-7, 116'444'736e9}, 1.22e17, 1.6e17},
    {"ticks", {TimeForm::kCount, 1e-7, 621'355'968e9}, 6.2e17, 6.7e17},
    {"since 1904", {TimeForm::kCount, 1.0, 2'082'844'800.0}, 3.5e9, 4.3e9},
    {"unix", {TimeForm::kCount, 1.0}, 6e8, 4e9},
    {"unix ms", {TimeForm::kCount, 1e-3}, 6e11, 4e12},
    {"unix us", {TimeForm::kCount, 1e-6}, 6e14, 4e15},
    {"unix ns", {TimeForm::kCount, 1e-9}, 6e17, 4e18},
    {"s", {TimeForm::kElapsed, 1.0}},
    {"ms", {TimeForm::kElapsed, 1e-3}},
    {"us", {TimeForm::kElapsed, 1e-6}},
    {"ns", {TimeForm::kElapsed, 1e-9}},
    {"min", {TimeForm::kElapsed, 60.0}},
    {"h", {TimeForm::kElapsed, 3600.0}},
    {"mjd",
     {TimeForm::kDaysUtc, kDay, 40587.0},
     4e4,
     8e4,
     false,
     "mjd|modified julian"},
    {"jd",
     {TimeForm::kDaysUtc, kDay, 2440587.5},
     2.44e6,
     2.5e6,
     true,
     "jd|julian"},
    {"serial", {TimeForm::kDays, kDay, 25569.0}, 3e4, 7e4, true},
    {"datenum", {TimeForm::kDays, kDay, 719529.0}, 7.2e5, 7.7e5, true},
    {"text", {TimeForm::kText}},
    {"clock", {TimeForm::kClock}},
    {"auto", {}},
};

bool EndsIn(std::string_view name, std::string_view unit) {
  const std::string text(unit);
  return name.ends_with('_' + text) || name.ends_with('[' + text + ']') ||
         name.ends_with('(' + text + ')');
}

bool Fits(const TimeRow& row, std::string_view name, double first) {
  if (row.high == 0.0) {
    return row.unit.form == TimeForm::kElapsed && EndsIn(name, row.name);
  }
  const bool named = !row.words.empty() && HasWord(PlainText(name), row.words);
  return first > row.low && first < row.high &&
         (named ||
          (row.fraction ? first != std::floor(first) : row.words.empty()));
}

}  // namespace

std::optional<TimeUnit> FindTimeUnit(std::string_view name) {
  const auto* const found = std::ranges::find(kTimeRows, name, &TimeRow::name);
  return found == std::end(kTimeRows) ? std::nullopt
                                      : std::optional(found->unit);
}

std::string_view TimeUnitName(const TimeUnit& unit) {
  const auto* const found = std::ranges::find(kTimeRows, unit, &TimeRow::unit);
  return found == std::end(kTimeRows) ? "auto" : found->name;
}

std::string TimeUnitNames() {
  return JoinText(kTimeRows, ", ", &TimeRow::name);
}

TimeUnit TimeUnitOf(std::string_view name, double first) {
  const auto* const found = std::ranges::find_if(
      kTimeRows, [&](const TimeRow& row) { return Fits(row, name, first); });
  return SameName(name, kTimeColumn) || found == std::end(kTimeRows)
             ? TimeUnit{TimeForm::kElapsed}
             : found->unit;
}

}  // namespace fdi::importer
