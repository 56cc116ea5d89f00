#include "import/elapsed.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <utility>

#include "base/csv_cells.h"
#include "base/time_text.h"

namespace fdi::importer {
namespace {

constexpr double kSecondsOfDay = 86400.0;

// "12 sec", "1.5 min"
std::optional<ElapsedTime> WithUnit(std::string_view text) {
  static constexpr std::pair<std::string_view, double> kUnits[] = {
      {"ms", 1e-3},      {"msec", 1e-3},   {"s", 1.0},    {"sec", 1.0},
      {"seconds", 1.0},  {"min", 60.0},    {"h", 3600.0}, {"hr", 3600.0},
      {"minutes", 60.0}, {"hours", 3600.0}};
  const std::size_t end = text.find_last_of("0123456789");
  if (end == std::string_view::npos) {
    return std::nullopt;
  }
  std::string_view unit = text.substr(end + 1);
  unit.remove_prefix(std::min(unit.find_first_not_of(' '), unit.size()));
  for (const auto& [name, seconds] : kUnits) {
    if (SameName(unit, name)) {
      const auto value = ParseNumber(text.substr(0, end + 1));
      return value ? std::optional(ElapsedTime{*value * seconds, 0.0})
                   : std::nullopt;
    }
  }
  return std::nullopt;
}

// "1 day, 02:03:04": the clock, and the days in seconds.
double TakeDays(std::string_view& text) {
  const std::size_t word = text.find(" day");
  const auto days = word == std::string_view::npos
                        ? std::nullopt
                        : ParseNumber(text.substr(0, word));
  if (!days) {
    return 0.0;
  }
  const std::size_t clock = text.find_first_of("0123456789", word);
  text.remove_prefix(std::min(clock, text.size()));
  return *days * kSecondsOfDay;
}

// Numbers between colons, of which the last may have a fraction.
std::optional<ElapsedTime> OfParts(std::string_view text, double days_s) {
  std::array<double, 3> parts{};
  std::size_t count = 0;
  bool fraction = false;
  for (std::string_view rest = text; !rest.empty() && count < 3; ++count) {
    const std::size_t end = rest.find(':');
    const std::string_view part = rest.substr(0, end);
    fraction = part.find_first_of(".,") != std::string_view::npos;
    const auto value =
        ParseNumber(part, part.find(',') != std::string_view::npos ? ',' : '.');
    if (!value || *value < 0.0 || (count > 0 && *value > 60.0) ||
        (fraction && end != std::string_view::npos)) {
      return std::nullopt;
    }
    parts.at(count) = *value;
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (count == 2 && !rest.empty()) {
      return std::nullopt;
    }
  }
  constexpr double kMaxHours = 1e4;
  if (parts[0] > kMaxHours) {
    return std::nullopt;  // "1773133200:0"
  }
  if (count == 3) {
    return ElapsedTime{days_s + 3600.0 * parts[0] + 60.0 * parts[1] + parts[2]};
  }
  if (count < 2) {
    return std::nullopt;
  }
  return fraction ? ElapsedTime{60.0 * parts[0] + parts[1], 3600.0}
                  : ElapsedTime{3600.0 * parts[0] + 60.0 * parts[1]};
}

}  // namespace

std::optional<ElapsedTime> ParseElapsed(std::string_view text) {
  if (text.empty() ||
      std::isdigit(static_cast<unsigned char>(text.front())) == 0) {
    return std::nullopt;
  }
  const double days_s = TakeDays(text);
  if (text.find(':') == std::string_view::npos) {
    return WithUnit(text);
  }
  if (const auto time = ScanTime("2000-01-01 " + std::string(text));
      time && !time->offset_s) {
    return ElapsedTime{days_s + 3600.0 * time->fields.tm_hour +
                       60.0 * time->fields.tm_min + time->fields.tm_sec +
                       1e-9 * static_cast<double>(time->fraction_ns)};
  }
  return OfParts(text, days_s);
}

}  // namespace fdi::importer
