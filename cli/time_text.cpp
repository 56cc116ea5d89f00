#include "cli/time_text.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <regex>

#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
/// No time is longer; a regular expression recurses with the length of a text.
constexpr std::size_t kLongestTime = 64;

[[noreturn]] void RefuseTime(std::string_view text) {
  throw ConfigError("'" + std::string(text) +
                    "' is not a time; accepted are 2026-11-20, "
                    "2026-11-20T14:56, 2026-11-20T14:56:11.5 and these with Z "
                    "or an offset such as +01:00");
}

// RFC 3339, where "T" may be a blank and clock, seconds and offset may be left
// out. Groups: year month day, hour minute second fraction, offset.
const std::regex& TimePattern() {
  static const std::regex pattern(
      R"((\d{4})-(\d\d)-(\d\d))"
      R"((?:[Tt ](\d\d):(\d\d)(?::(\d\d))?(?:\.(\d+))?)?)"
      R"(([Zz]|[+-]\d\d:?\d\d)?)");
  return pattern;
}

struct Reading {
  std::tm fields{};
  std::int64_t fraction_ns{0};
  std::optional<int> offset_s;  // Of local time from UTC.
};

Reading Read(std::string_view text) {
  std::cmatch found;
  if (text.size() > kLongestTime ||
      !std::regex_match(text.data(), text.data() + text.size(), found,
                        TimePattern())) {
    RefuseTime(text);
  }
  const auto number = [](std::string_view digits) {
    int value = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return value;
  };
  const auto group = [&found, &number](std::size_t i) {
    return number({found[i].first, found[i].second});
  };
  Reading reading;
  reading.fields.tm_year = group(1) - 1900;
  reading.fields.tm_mon = group(2) - 1;
  reading.fields.tm_mday = group(3);
  reading.fields.tm_hour = group(4);
  reading.fields.tm_min = group(5);
  reading.fields.tm_sec = group(6);
  const std::chrono::year_month_day date{
      std::chrono::year(group(1)),
      std::chrono::month(static_cast<unsigned>(group(2))),
      std::chrono::day(static_cast<unsigned>(group(3)))};
  // A leap second has the number 60.
  if (!date.ok() || group(4) > 23 || group(5) > 59 || group(6) > 60) {
    RefuseTime(text);
  }
  std::int64_t unit = kSecond;
  for (const char digit : found[7].str()) {
    unit /= 10;
    reading.fraction_ns += unit * (digit - '0');
  }
  if (const std::string offset = found[8]; !offset.empty()) {
    const bool utc = offset.size() == 1;
    const int hours = utc ? 0 : number(std::string_view(offset).substr(1, 2));
    const int minutes =
        utc ? 0 : number(std::string_view(offset).substr(offset.size() - 2));
    if (hours > 23 || minutes > 59) {
      RefuseTime(text);
    }
    reading.offset_s =
        (offset.front() == '-' ? -60 : 60) * (60 * hours + minutes);
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

bool IsDuration(std::string_view text) {
  return !text.empty() && text.find_first_of("T:-") == std::string_view::npos;
}

}  // namespace

std::string FormatTime(std::int64_t stamp_ns, bool utc) {
  // 0 or more, also before 1970, where % would give a negative rest.
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
    fields.tm_isdst = -1;  // mktime() finds out whether it was summer time.
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
  static const std::regex plain(R"(\d+\.?\d*|\.\d+)");
  static const std::regex part(
      R"((\d+\.?\d*|\.\d+)(ns|us|ms|s|min|m|h|d|w)(?![a-z]))");
  double seconds = 0.0;
  const std::string whole(text.substr(0, kLongestTime + 1));
  if (std::regex_match(whole, plain)) {
    seconds = std::strtod(whole.c_str(), nullptr);
  } else {
    // The parts must follow each other without a gap up to the end.
    std::string rest = whole;
    std::smatch found;
    while (std::regex_search(rest, found, part,
                             std::regex_constants::match_continuous)) {
      const std::string name = found[2];
      const auto unit = std::ranges::find(kUnits, name, &Unit::name);
      seconds += std::strtod(found.str(1).c_str(), nullptr) * unit->seconds;
      rest = found.suffix();
    }
    if (whole.empty() || !rest.empty()) {
      RefuseDuration(text);
    }
  }
  if (whole.size() > kLongestTime || seconds > 100.0 * 365.25 * 86400.0) {
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
