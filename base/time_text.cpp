#include "base/time_text.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <limits>
#include <optional>
#include <regex>
#include <stdexcept>

#include <date/tz.h>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "base/time_units.h"

namespace fdi {
namespace {

/// std::regex recurses with the length of its input.
constexpr std::size_t kMaxTimeLength = 64;

constexpr const char* kTimeForms =
    "2026-11-20, 2026-11-20T14:56, 2026-11-20T14:56:11.5 and these with Z or "
    "an offset such as +01:00";

[[noreturn]] void RefuseTime(std::string_view text) {
  throw ConfigError("'" + std::string(text) + "' is not a time; accepted are " +
                    kTimeForms);
}

// A cursor over the text of a time.
// The grammar is:
//
//     time    = [weekday] date [[","] ("T" / "t" / " ") clock] [offset]
//             / [weekday] month " " day " " clock [" " zone] " " YYYY
//     date    = YYYY s month s day / day s month s (YYYY / YY)   one s per date
//             / YYYY "-W" week "-" day / YYYY "-" day of the year   3DIGIT
//             / month " " day [","] " " YYYY
//     month   = number / a name in one of six languages, or its beginning
//     clock   = hh ":" mm [":" ss [("." / "," / ":") 1*DIGIT]]
//               [[" "] ("AM" / "PM" / "a. m." / "p. m.")]
//     offset  = [" "] (zone [hours] / hours)
//     hours   = ("+" / "-") hh [[":"] mm]
//
// "20260310T090000" and "20260310090000" are those without signs, and
// "+01:00[Europe/Berlin]" and "(CET)" behind an offset add nothing to it.
//
// A year of two digits, 1970 to 2069, is accepted beside the name of a month,
// behind points ("10.03.26") and where the order is said: in "01-02-03" nothing
// shows which number is the year.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : rest_(text) {}

  bool done() const { return rest_.empty(); }
  char next() const { return rest_.empty() ? '\0' : rest_.front(); }
  bool Take(std::string_view any) {
    if (rest_.empty() || any.find(rest_.front()) == std::string_view::npos) {
      return false;
    }
    rest_.remove_prefix(1);
    return true;
  }
  // Digits only; sets `count` to the number of digits.
  std::optional<int> Number(std::size_t* count = nullptr) {
    const std::size_t digits =
        std::min(rest_.find_first_not_of("0123456789"), rest_.size());
    int value = 0;
    const auto [end, error] =
        std::from_chars(rest_.data(), rest_.data() + digits, value);
    if (count != nullptr) {
      *count = digits;
    }
    if (error != std::errc() || digits > 4) {
      return std::nullopt;
    }
    rest_.remove_prefix(digits);
    return value;
  }
  std::string_view Word() {
    const auto end = std::ranges::find_if(rest_, [](char c) {
      return !std::isalpha(static_cast<unsigned char>(c));
    });
    const std::string_view word(rest_.data(),
                                static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(word.size());
    return word;
  }
  // Digits beyond nanoseconds are read and dropped: `unit` is 0 by then.
  std::int64_t Fraction() {
    std::int64_t unit = kNsPerSecond;
    std::int64_t fraction = 0;
    for (; std::isdigit(static_cast<unsigned char>(next())) != 0;
         rest_.remove_prefix(1)) {
      unit /= 10;
      fraction += unit * (next() - '0');
    }
    return fraction;
  }

 private:
  std::string_view rest_;
};

// 1..12 by the first letters, without accents, of the names in English, German,
// French, Spanish, Italian and Polish: no two months share any. "Juin" and
// "juillet" need a fourth.
std::optional<int> MonthOf(std::string_view word) {
  static constexpr std::string_view kMonths[] = {
      "|jan|ene|gen|sty|",  "|feb|fev|lut|",     "|mar|mrz|mae|",
      "|apr|avr|abr|kwi|",  "|may|mai|mag|maj|", "|jun|juin|giu|cze|",
      "|jul|juil|lug|lip|", "|aug|aou|ago|sie|", "|sep|set|wrz|",
      "|oct|okt|ott|paz|",  "|nov|lis|",         "|dec|dez|dic|gru|"};
  const std::string name = Lower(word);
  for (const std::size_t letters : {4U, 3U}) {
    for (std::size_t i = 0; i < std::size(kMonths) && name.size() >= letters;
         ++i) {
      if (kMonths[i].find('|' + name.substr(0, letters) + '|') !=
          std::string_view::npos) {
        return static_cast<int>(i) + 1;
      }
    }
  }
  return std::nullopt;
}

// timegm() would turn 31 February into 3 March without an error.
bool TakeDate(int year, int month, int day, std::tm& fields) {
  fields.tm_year = year - 1900;
  fields.tm_mon = month - 1;
  fields.tm_mday = day;
  return std::chrono::year_month_day{
      std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
      std::chrono::day(static_cast<unsigned>(day))}
      .ok();
}

bool TakeDays(std::chrono::sys_days days, std::tm& fields) {
  const std::chrono::year_month_day date(days);
  return TakeDate(static_cast<int>(date.year()),
                  static_cast<int>(static_cast<unsigned>(date.month())),
                  static_cast<int>(static_cast<unsigned>(date.day())), fields);
}

// Behind "2026-": "W11-2", whose week 1 has 4 January in it.
bool ScanWeek(Scanner& in, int year, std::tm& fields) {
  in.Take("Ww");
  const auto week = in.Number();
  const auto day = in.Take("-") ? in.Number() : std::nullopt;
  if (!week || !day || *week < 1 || *week > 53 || *day < 1 || *day > 7) {
    return false;
  }
  const std::chrono::sys_days fourth = std::chrono::year(year) / 1 / 4;
  const auto weekday = std::chrono::weekday(fourth).iso_encoding();
  return TakeDays(fourth + std::chrono::days(7 * (*week - 1) + *day -
                                             static_cast<int>(weekday)),
                  fields);
}

// Behind "2026-": "069".
bool TakeDayOfYear(int year, int day, std::tm& fields) {
  const std::chrono::sys_days first = std::chrono::year(year) / 1 / 1;
  return day >= 1 && TakeDays(first + std::chrono::days(day - 1), fields) &&
         fields.tm_year == year - 1900;
}

// Nov 20, 2026
bool ScanAmericanDate(Scanner& in, std::tm& fields) {
  const auto month = MonthOf(in.Word());
  const auto day = in.Take(" ") ? in.Number() : std::nullopt;
  in.Take(",");
  if (!month || !day || !in.Take(" ")) {
    return false;
  }
  std::size_t digits = 0;
  const auto year = in.Number(&digits);
  return year && digits == 4 && TakeDate(*year, *month, *day, fields);
}

// "Tue, ", "Tue ", "Di., ", "mardi ": in the six languages of MonthOf(). "mar"
// is also a month, which a day and a year follow.
void SkipWeekday(Scanner& in) {
  Scanner ahead = in;
  const std::string word = Lower(ahead.Word());
  constexpr std::string_view kDays =
      "|mon|tue|wed|thu|fri|sat|sun|mo|di|mi|do|fr|sa|so|die|mit|don|fre|sam|"
      "son|lun|mar|mer|jeu|ven|dim|mie|jue|vie|sab|dom|gio|pon|wto|sro|czw|pia|"
      "sob|nie|pn|wt|sr|cz|pt|nd|";
  if (word.size() < 2 ||
      kDays.find('|' + word.substr(0, 3) + '|') == std::string_view::npos) {
    return;
  }
  ahead.Take(".");
  ahead.Take(",");
  ahead.Take(" ");
  if (word.starts_with("mar")) {
    Scanner day = ahead;
    if (!day.Number() || !(day.next() == '/' || day.next() == '.')) {
      return;
    }
  }
  in = ahead;
}

// 2026-11-20, 20.11.2026, 20-Nov-2026, 20-Nov-26, 20.11.26, Nov 20, 2026;
// 20/11/2026 and 20/11/26 by `order`.
bool ScanDate(Scanner& in, DateOrder order, std::tm& fields) {
  SkipWeekday(in);
  if (std::isalpha(static_cast<unsigned char>(in.next())) != 0) {
    return ScanAmericanDate(in, fields);
  }
  std::size_t digits = 0;
  const auto first = in.Number(&digits);
  const bool iso =
      digits == 4 || (digits <= 2 && order == DateOrder::kYearFirst);
  const char separator = in.next();
  if (!first || !in.Take(iso ? "-/." : "./- ")) {
    return false;
  }
  const std::size_t first_digits = digits;
  if (first_digits == 4 && separator == '-' &&
      (in.next() == 'W' || in.next() == 'w')) {
    return ScanWeek(in, *first, fields);
  }
  in.Take(separator == '.' ? " " : "");  // "10. Nov. 2026"
  const bool named = std::isalpha(static_cast<unsigned char>(in.next())) != 0;
  auto month = named ? MonthOf(in.Word()) : in.Number(&digits);
  if (month && !named && first_digits == 4 && digits == 3 && separator == '-') {
    return TakeDayOfYear(*first, *month, fields);
  }
  const bool dot = named && in.Take(".");
  const bool next =
      in.Take(named && separator == '.' ? std::string_view(" ")
                                        : std::string_view(&separator, 1));
  if (!month || (separator == ' ' && !named) ||
      !(next || (dot && separator == '.'))) {
    return false;
  }
  auto last = in.Number(&digits);
  if (!last) {
    return false;
  }
  auto day = iso ? last : first;
  auto year = iso ? first : last;
  const std::size_t year_digits = iso ? first_digits : digits;
  if (year_digits == 2) {
    *year += *year < 70 ? 2000 : 1900;
  } else if (year_digits != 4) {
    return false;
  }
  // Dates with points are taken as day first. With slashes or dashes the order
  // depends on the country, so a file has to say it.
  if (!iso && !named && separator != '.') {
    if (order == DateOrder::kNotSaid) {
      return false;
    }
    if (order == DateOrder::kMonthFirst) {
      std::swap(day, month);
    }
  }
  return TakeDate(*year, *month, *day, fields);
}

// "AM", " p. m.": whether it is the afternoon. A copy looks ahead, because the
// blank may belong to an offset: "14:56 UTC".
std::optional<bool> ScanHalf(Scanner& in) {
  Scanner ahead = in;
  ahead.Take(" ");
  std::string half = Lower(ahead.Word());
  if (half == "a" || half == "p") {
    ahead.Take(".");
    ahead.Take(" ");
    half += Lower(ahead.Word());
    ahead.Take(".");
  }
  if (half != "am" && half != "pm") {
    return std::nullopt;
  }
  in = ahead;
  return half == "pm";
}

// " 14:56", "T14:56:11.5", "14:56:11,5 PM"
bool ScanClock(Scanner& in, CivilTime& time) {
  const auto hour = in.Number();
  const auto minute = in.Take(":") ? in.Number() : std::nullopt;
  if (!hour || !minute) {
    return false;
  }
  time.fields.tm_hour = *hour;
  time.fields.tm_min = *minute;
  if (in.Take(":")) {
    const auto second = in.Number();
    if (!second) {
      return false;
    }
    time.fields.tm_sec = *second;
    // Some write "09:00:00:250", with all three digits.
    Scanner fraction = in;
    std::size_t digits = 0;
    const bool colon =
        fraction.Take(":") && fraction.Number(&digits) && digits == 3;
    if (in.Take(colon ? ":" : ".,")) {
      if (std::isdigit(static_cast<unsigned char>(in.next())) == 0) {
        return false;
      }
      time.fraction_ns = in.Fraction();
    }
  }
  if (const auto noon = ScanHalf(in)) {
    if (*hour < 1 || *hour > 12) {
      return false;
    }
    // 12 AM is midnight and 12 PM is noon.
    time.fields.tm_hour = *hour % 12 + (*noon ? 12 : 0);
  }
  // A leap second has number 60.
  return time.fields.tm_hour <= 23 && *minute <= 59 && time.fields.tm_sec <= 60;
}

// Minutes from UTC. Names that several countries use for different times (CST,
// MST, IST, BST) are none.
std::optional<int> ZoneOf(std::string_view name) {
  static constexpr std::pair<std::string_view, int> kZones[] = {
      {"z", 0},      {"utc", 0},    {"gmt", 0},    {"wet", 0},    {"west", 60},
      {"cet", 60},   {"mez", 60},   {"cest", 120}, {"mesz", 120}, {"eet", 120},
      {"eest", 180}, {"est", -300}, {"edt", -240}, {"cdt", -300}, {"mdt", -360},
      {"pst", -480}, {"pdt", -420}};
  const std::string lower = Lower(name);
  for (const auto& [zone, minutes] : kZones) {
    if (zone == lower) {
      return minutes;
    }
  }
  return std::nullopt;
}

// "Z", " UTC", " CEST", "+01:00", "+0100", "+01", "GMT+0100"
bool ScanOffset(Scanner& in, CivilTime& time) {
  in.Take(" ");
  if (std::isalpha(static_cast<unsigned char>(in.next())) != 0) {
    const auto zone = ZoneOf(in.Word());
    time.offset_s = 60 * zone.value_or(0);
    if (!zone || in.done() || *zone != 0) {
      return zone && in.done();
    }
  }
  const int sign = in.next() == '-' ? -1 : 1;
  std::size_t digits = 0;
  auto hours = in.Take("+-") ? in.Number(&digits) : std::nullopt;
  if (!hours || (digits != 2 && digits != 4)) {
    return false;
  }
  std::optional<int> minutes = digits == 4 ? *hours % 100 : 0;
  if (digits == 4) {
    *hours /= 100;
  } else if (in.Take(":")) {
    minutes = in.Number(&digits);
  }
  if (!in.done() || !minutes || digits % 2 != 0 || *hours > 23 ||
      *minutes > 59) {
    return false;
  }
  time.offset_s = sign * 60 * (60 * *hours + *minutes);
  return true;
}

// "Mar 10 05:00:00 EDT 2026", as ctime() and date(1) write it.
std::optional<CivilTime> ScanCtime(Scanner in) {
  CivilTime time;
  SkipWeekday(in);
  const auto month = MonthOf(in.Word());
  in.Take(" ");
  in.Take(" ");
  const auto day = in.Number();
  if (!month || !day || !in.Take(" ") || !ScanClock(in, time) ||
      !in.Take(" ")) {
    return std::nullopt;
  }
  if (const std::string_view name = in.Word(); !name.empty()) {
    const auto zone = ZoneOf(name);
    if (!zone || !in.Take(" ")) {
      return std::nullopt;
    }
    time.offset_s = 60 * *zone;
  }
  std::size_t digits = 0;
  const auto year = in.Number(&digits);
  return year && digits == 4 && in.done() &&
                 TakeDate(*year, *month, *day, time.fields)
             ? std::optional(time)
             : std::nullopt;
}

// True if a time begins with eight or fourteen digits, of this century or the
// last: "20260310T0900", "20260310090000".
bool IsBasic(std::string_view text) {
  const std::size_t digits =
      std::min(text.find_first_not_of("0123456789"), text.size());
  return (text.starts_with("19") || text.starts_with("20")) &&
         (digits == 14 || digits == 17 ||
          (digits == 8 && text.size() > 9 &&
           std::string_view("Tt ").find(text[8]) != std::string_view::npos));
}

// With plain letters and blanks, with signs, and without a comment at the end.
std::string Rewritten(std::string_view text) {
  std::string plain(text);
  for (const std::string_view blank : {"\xC2\xA0", "\xE2\x80\xAF"}) {
    for (std::size_t at = plain.find(blank); at != std::string::npos;
         at = plain.find(blank)) {
      plain.replace(at, blank.size(), " ");
    }
  }
  plain = PlainText(plain);
  const std::size_t note = plain.find_first_of("[(");
  if (note != std::string::npos && note > 10) {
    plain.resize(plain[note - 1] == ' ' ? note - 1 : note);
  }
  if (!IsBasic(plain)) {
    return plain;
  }
  const auto part = [&](std::size_t from, std::size_t count) {
    return plain.substr(from, count);
  };
  const std::string date = part(0, 4) + '-' + part(4, 2) + '-' + part(6, 2);
  const std::size_t begin =
      std::isdigit(static_cast<unsigned char>(plain[8])) != 0 ? 8 : 9;
  const std::size_t digits =
      std::min(plain.find_first_not_of("0123456789", begin), plain.size()) -
      begin;
  if (digits < 4) {
    return date + ' ' + part(begin, std::string::npos);
  }
  return date + ' ' + part(begin, 2) + ':' + part(begin + 2, 2) +
         (digits >= 6 ? ':' + part(begin + 4, 2) : std::string()) +
         (digits > 6 ? "." : "") +
         part(begin + std::min<std::size_t>(digits, 6), std::string::npos);
}

struct Unit {
  std::string_view name;
  double seconds;
};
constexpr Unit kDurationUnits[] = {
    {"ns", 1e-9}, {"us", 1e-6},  {"ms", 1e-3},   {"s", 1.0},     {"min", 60.0},
    {"m", 60.0},  {"h", 3600.0}, {"d", 86400.0}, {"w", 604800.0}};

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
  // Non-negative also before 1970, where % gives a negative remainder.
  const std::int64_t fraction =
      ((stamp_ns % kNsPerSecond) + kNsPerSecond) % kNsPerSecond;
  const std::time_t seconds =
      stamp_ns / kNsPerSecond - (stamp_ns % kNsPerSecond < 0 ? 1 : 0);
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

std::optional<CivilTime> ScanTime(std::string_view text, DateOrder order) {
  // Nearly all times are plain.
  std::string rewritten;
  if (text.size() > 10 &&
      (std::ranges::any_of(text, [](char c) { return (c & 0x80) != 0; }) ||
       text.ends_with(']') || text.ends_with(')') || IsBasic(text))) {
    rewritten = Rewritten(text);
    text = rewritten;
  }
  CivilTime time;
  Scanner in(text);
  if (text.size() > kMaxTimeLength) {
    return std::nullopt;
  }
  if (!ScanDate(in, order, time.fields)) {
    return ScanCtime(Scanner(text));
  }
  in.Take(",");
  const bool clock = in.Take("Tt ");
  if ((clock && !ScanClock(in, time)) ||
      (!in.done() && !ScanOffset(in, time))) {
    return std::nullopt;
  }
  return time;
}

namespace {

// The zone of this name in the time zone database of the machine, or nothing.
const date::time_zone* FindZone(const std::string& name) {
  try {
    return date::locate_zone(name);
  } catch (const std::runtime_error&) {
    return nullptr;
  }
}

// Debian 13 moved the names that are not places to the package tzdata-legacy.
// The places are those of the time zone database 2024b (file backward), for the
// names that plants use.
std::string PlaceOf(std::string zone) {
  static constexpr std::pair<std::string_view, const char*> kPlaces[] = {
      {"CET", "Europe/Brussels"},        {"MET", "Europe/Brussels"},
      {"EET", "Europe/Athens"},          {"WET", "Europe/Lisbon"},
      {"EST", "America/Panama"},         {"EST5EDT", "America/New_York"},
      {"CST6CDT", "America/Chicago"},    {"MST", "America/Phoenix"},
      {"MST7MDT", "America/Denver"},     {"HST", "Pacific/Honolulu"},
      {"PST8PDT", "America/Los_Angeles"}};
  for (const auto& [name, place] : kPlaces) {
    if (name == zone && FindZone(zone) == nullptr) {
      return place;
    }
  }
  return zone;
}

}  // namespace

LocalClock::LocalClock(std::string zone) : zone_(PlaceOf(std::move(zone))) {
  CivilTime offset;
  Scanner scanner(zone_);
  // "CET" is a zone with summer time, and a fixed offset only behind a time.
  if (zone_.empty()) {
    return;
  }
  if (ZoneOf(zone_).value_or(0) == 0 && ScanOffset(scanner, offset)) {
    fixed_s_ = offset.offset_s;
    return;
  }
  rules_ = FindZone(zone_);
  if (rules_ == nullptr) {
    throw ConfigError("zone '" + zone_ +
                      "' is not known here; accepted are UTC, offsets such as "
                      "+01:00 and, with the package tzdata, names such as "
                      "Europe/Warsaw (with tzdata-legacy also old ones such as "
                      "US/Central)");
  }
}

int LocalClock::OffsetAt(std::time_t utc_s) const {
  if (fixed_s_) {
    return *fixed_s_;
  }
  if (rules_ != nullptr) {
    const date::sys_seconds instant{std::chrono::seconds(utc_s)};
    return static_cast<int>(rules_->get_info(instant).offset.count());
  }
  std::tm fields{};
  localtime_r(&utc_s, &fields);
  return static_cast<int>(fields.tm_gmtoff);
}

std::optional<std::int64_t> LocalClock::Utc(const CivilTime& time,
                                            std::int64_t last_ns) const {
  constexpr std::time_t kDay = 86'400;
  constexpr std::time_t kLimit = 9'223'372'000;  // int64 ns overflow in 2262.
  std::tm fields = time.fields;
  const std::time_t shown = timegm(&fields);
  std::optional<std::int64_t> found;
  // A clock is changed at most once in two days, so its offset is the one of
  // the day before or the one of the day after. An offset counts if it was in
  // force at the instant that it leads to: neither was in the hour that is
  // skipped in spring, both were in the hour that is repeated in autumn. The
  // one of the day before leads to the earlier instant of the two.
  for (const std::time_t other_day : {shown - kDay, shown + kDay}) {
    const int offset = time.offset_s ? *time.offset_s : OffsetAt(other_day);
    const std::time_t utc = shown - offset;
    if (utc < -kLimit || utc > kLimit ||
        (!time.offset_s && OffsetAt(utc) != offset)) {
      continue;
    }
    if (!found || *found < last_ns) {
      found = utc * kNsPerSecond + time.fraction_ns;
    }
  }
  return found;
}

std::int64_t ParseTime(std::string_view text, const LocalClock& clock) {
  const auto time = ScanTime(text);
  const auto stamp =
      time ? clock.Utc(*time, std::numeric_limits<std::int64_t>::min())
           : std::nullopt;
  if (!stamp) {
    RefuseTime(text);
  }
  return *stamp;
}

std::int64_t ParseTime(std::string_view text, bool utc) {
  return ParseTime(text, LocalClock(utc ? "UTC" : ""));
}

std::int64_t ParseTimeOrAgo(std::string_view text, bool utc,
                            std::int64_t now_ns) {
  if (text == "now") {
    return now_ns;
  }
  try {
    return IsDuration(text) ? now_ns - ParseDuration(text)
                            : ParseTime(text, utc);
  } catch (const ConfigError&) {
    throw ConfigError("'" + std::string(text) +
                      "' is not a time; accepted are " + kTimeForms +
                      ", a time before now such as 90s, 2h, 1h30m or 7d, up to "
                      "100 years, and now");
  }
}

std::int64_t ParseDuration(std::string_view text) {
  //     duration = number / 1*(number unit)     without a unit: seconds
  static const std::regex plain(R"(\d+\.?\d*|\.\d+)");
  static const std::regex part(
      R"((\d+\.?\d*|\.\d+)(ns|us|ms|s|min|m|h|d|w)(?![a-z]))");
  double seconds = 0.0;
  const std::string whole(text.substr(0, kMaxTimeLength + 1));
  if (std::regex_match(whole, plain)) {
    seconds = std::strtod(whole.c_str(), nullptr);
  } else {
    // The parts must be contiguous up to the end.
    std::string rest = whole;
    std::smatch found;
    while (std::regex_search(rest, found, part,
                             std::regex_constants::match_continuous)) {
      const std::string name = found[2];
      const auto unit = std::ranges::find(kDurationUnits, name, &Unit::name);
      seconds += std::strtod(found.str(1).c_str(), nullptr) * unit->seconds;
      rest = found.suffix();
    }
    if (whole.empty() || !rest.empty()) {
      RefuseDuration(text);
    }
  }
  // `whole` was cut one character beyond the limit, which shows that `text` is
  // longer. 100 years in nanoseconds fit into 64 bits, also when subtracted
  // from now.
  if (whole.size() > kMaxTimeLength || seconds > 100.0 * 365.25 * 86400.0) {
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
    } else if (whole < 2LL * 86400) {
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

}  // namespace fdi
