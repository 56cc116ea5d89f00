#include "storage/cli/time_text.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>

#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

[[noreturn]] void RefuseTime(std::string_view text) {
  throw ConfigError("'" + std::string(text) +
                    "' is not a time; accepted are 2026-11-20, "
                    "2026-11-20T14:56, 2026-11-20T14:56:11.5 and these with Z "
                    "or an offset such as +01:00");
}

// Reads exactly `digits` digits at `position`, which moves behind them.
std::optional<int> Digits(std::string_view text, std::size_t& position,
                          std::size_t digits) {
  if (position + digits > text.size()) {
    return std::nullopt;
  }
  int value = 0;
  for (std::size_t i = 0; i < digits; ++i) {
    const char c = text[position + i];
    if (c < '0' || c > '9') {
      return std::nullopt;
    }
    value = 10 * value + (c - '0');
  }
  position += digits;
  return value;
}

bool Take(std::string_view text, std::size_t& position, char c) {
  if (position < text.size() && text[position] == c) {
    ++position;
    return true;
  }
  return false;
}

struct Reading {
  std::tm fields{};
  std::int64_t fraction_ns{0};
  std::optional<int> offset_s;
};

// "[Tt ]hh:mm[:ss[.fff]]"; false if malformed.
bool ReadClock(std::string_view text, std::size_t& at, Reading& reading) {
  const auto hour = Digits(text, at, 2);
  if (!hour || !Take(text, at, ':')) {
    return false;
  }
  const auto minute = Digits(text, at, 2);
  std::optional<int> second = 0;
  if (minute && Take(text, at, ':')) {
    second = Digits(text, at, 2);
  }
  if (!minute || !second || *hour > 23 || *minute > 59 || *second > 60) {
    return false;
  }
  if (Take(text, at, '.')) {
    std::int64_t unit = kSecond / 10;
    const std::size_t first = at;
    for (; at < text.size() && text[at] >= '0' && text[at] <= '9'; ++at) {
      reading.fraction_ns += unit * (text[at] - '0');
      unit /= 10;
    }
    if (at == first) {
      return false;
    }
  }
  reading.fields.tm_hour = *hour;
  reading.fields.tm_min = *minute;
  reading.fields.tm_sec = *second;
  return true;
}

// "Z", "+hh:mm", "-hh:mm" or nothing; false if malformed.
bool ReadOffset(std::string_view text, std::size_t& at, Reading& reading) {
  if (at == text.size()) {
    return true;
  }
  if (Take(text, at, 'Z') || Take(text, at, 'z')) {
    reading.offset_s = 0;
    return at == text.size();
  }
  const bool west = Take(text, at, '-');
  if (!west && !Take(text, at, '+')) {
    return false;
  }
  const auto hours = Digits(text, at, 2);
  Take(text, at, ':');
  const auto minutes = Digits(text, at, 2);
  if (!hours || !minutes || *hours > 23 || *minutes > 59 || at != text.size()) {
    return false;
  }
  reading.offset_s = (west ? -1 : 1) * (*hours * 3600 + *minutes * 60);
  return true;
}

Reading Read(std::string_view text) {
  Reading reading;
  std::size_t at = 0;
  const auto year = Digits(text, at, 4);
  const bool dash1 = Take(text, at, '-');
  const auto month = Digits(text, at, 2);
  const bool dash2 = Take(text, at, '-');
  const auto day = Digits(text, at, 2);
  if (!year || !month || !day || !dash1 || !dash2 ||
      !(std::chrono::year(*year) /
        std::chrono::month(static_cast<unsigned>(*month)) /
        std::chrono::day(static_cast<unsigned>(*day)))
           .ok()) {
    RefuseTime(text);
  }
  reading.fields.tm_year = *year - 1900;
  reading.fields.tm_mon = *month - 1;
  reading.fields.tm_mday = *day;
  if (at < text.size() &&
      (text[at] == 'T' || text[at] == 't' || text[at] == ' ')) {
    ++at;
    if (!ReadClock(text, at, reading)) {
      RefuseTime(text);
    }
  }
  if (!ReadOffset(text, at, reading)) {
    RefuseTime(text);
  }
  return reading;
}

struct Unit {
  std::string_view name;
  double seconds;
};
constexpr Unit kUnits[] = {{"ns", 1e-9},  {"us", 1e-6},   {"ms", 1e-3},
                           {"s", 1.0},    {"min", 60.0},  {"m", 60.0},
                           {"h", 3600.0}, {"d", 86400.0}, {"w", 604800.0}};

[[noreturn]] void RefuseDuration(std::string_view text) {
  throw ConfigError("'" + std::string(text) +
                    "' is not a duration; accepted are numbers with ns, us, "
                    "ms, s, m, min, h, d or w, such as 90s, 2h or 1h30m, up "
                    "to 100 years, and plain seconds");
}

double UnitSeconds(std::string_view name, std::string_view text) {
  for (const Unit& unit : kUnits) {
    if (unit.name == name) {
      return unit.seconds;
    }
  }
  RefuseDuration(text);
}

bool IsDuration(std::string_view text) {
  return !text.empty() && text.find_first_of("T:-") == std::string_view::npos;
}

}  // namespace

std::string FormatTime(std::int64_t stamp_ns, bool utc) {
  const std::int64_t fraction = ((stamp_ns % kSecond) + kSecond) % kSecond;
  const std::time_t seconds = (stamp_ns - fraction) / kSecond;
  std::tm fields{};
  utc ? gmtime_r(&seconds, &fields) : localtime_r(&seconds, &fields);
  char text[64];
  std::size_t length =
      std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &fields);
  std::string result(text, length);
  if (fraction != 0) {
    std::snprintf(text, sizeof text, ".%09lld",
                  static_cast<long long>(fraction));
    const int decimals =
        fraction % 1'000'000 == 0 ? 3 : (fraction % 1'000 == 0 ? 6 : 9);
    result.append(text, static_cast<std::size_t>(decimals) + 1);
  }
  if (utc) {
    return result + 'Z';
  }
  const long offset_min = fields.tm_gmtoff / 60;
  std::snprintf(text, sizeof text, "%c%02ld:%02ld", offset_min < 0 ? '-' : '+',
                std::labs(offset_min) / 60, std::labs(offset_min) % 60);
  return result + text;
}

std::int64_t ParseTime(std::string_view text, bool utc) {
  Reading reading = Read(text);
  std::tm fields = reading.fields;
  std::time_t seconds = 0;
  if (reading.offset_s || utc) {
    seconds = timegm(&fields) - reading.offset_s.value_or(0);
  } else {
    fields.tm_isdst = -1;
    seconds = mktime(&fields);
  }
  constexpr std::time_t kLimit = 9'223'372'000;  // int64 ns end in 2262.
  if (seconds < -kLimit || seconds > kLimit) {
    RefuseTime(text);
  }
  return seconds * kSecond + reading.fraction_ns;
}

std::int64_t ParseTimeOrAgo(std::string_view text, bool utc,
                            std::int64_t now_ns) {
  if (text == "now") {
    return now_ns;
  }
  return IsDuration(text) ? now_ns - ParseDuration(text) : ParseTime(text, utc);
}

std::int64_t ParseDuration(std::string_view text) {
  double seconds = 0.0;
  std::size_t at = 0;
  if (text.empty()) {
    RefuseDuration(text);
  }
  while (at < text.size()) {
    const std::size_t end = text.find_first_not_of("0123456789.", at);
    const std::string number(text.substr(at, end - at));
    char* stop = nullptr;
    const double value = std::strtod(number.c_str(), &stop);
    if (number.empty() || *stop != '\0') {
      RefuseDuration(text);
    }
    if (end == std::string_view::npos) {
      if (at != 0) {
        RefuseDuration(text);  // "1h30": thirty what?
      }
      seconds = value;
      break;
    }
    const std::size_t next =
        std::min(text.find_first_of("0123456789.", end), text.size());
    seconds += value * UnitSeconds(text.substr(end, next - end), text);
    at = next;
  }
  if (seconds > 100.0 * 365.25 * 86400.0) {
    RefuseDuration(text);
  }
  return std::llround(seconds * 1e9);
}

std::string FormatDuration(std::int64_t duration_ns) {
  const double seconds = static_cast<double>(duration_ns) * 1e-9;
  char text[64];
  if (seconds < 10.0) {
    std::snprintf(text, sizeof text, "%.2f s", seconds);
  } else if (seconds < 120.0) {
    std::snprintf(text, sizeof text, "%.0f s", seconds);
  } else {
    const auto whole = std::llround(seconds);
    if (whole < 7200) {
      std::snprintf(text, sizeof text, "%lld min %02lld s", whole / 60,
                    whole % 60);
    } else if (whole < 2 * 86400) {
      std::snprintf(text, sizeof text, "%lld h %02lld min", whole / 3600,
                    whole % 3600 / 60);
    } else {
      std::snprintf(text, sizeof text, "%lld d %02lld h", whole / 86400,
                    whole % 86400 / 3600);
    }
  }
  return text;
}

std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace fdi::cli
