#include "storage/history/healthy_hours.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "base/error.h"
#include "base/time_units.h"
#include "storage/history/health.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr std::int64_t kMaxHours = 200'000;   // They are read in 0.2 s.
constexpr std::int64_t kLeastPerValve = 200;  // Tails take 72 healthy ones.
constexpr std::int64_t kRecent = 168;         // Hours: a standstill of a week.
constexpr double kJudged = 0.9;               // of an hour
constexpr std::int64_t kHoursPerDay = 24;

bool IsHealthy(const HealthHour& hour) {
  return hour.share > 0 && static_cast<double>(hour.live_ms - hour.alarm_ms) >=
                               kJudged * static_cast<double>(kMsPerHour);
}

bool IsOfSet(const HealthHour& hour, const HealthHour& set) {
  return hour.model_hash == set.model_hash && hour.epoch == set.epoch;
}

// The present set, of hours with the newest first. In the hour of a swap there
// are two, of which the hours before have the old one.
const HealthHour& PresentSet(const std::vector<HealthHour>& hours) {
  const std::int64_t newest = hours.front().hour;
  const auto found = std::ranges::find_if(hours, [&](const HealthHour& set) {
    return set.hour == newest &&
           std::ranges::none_of(hours, [&](const auto& h) {
             return h.hour < newest && IsOfSet(h, set);
           });
  });
  return found != hours.end() ? *found : hours.front();
}

// An episode labelled a fault says nothing of a healthy valve.
void AddEpisodes(Database& database, std::int64_t since_ns,
                 HealthyHours& valve) {
  Statement& row = database.Cached(sql::shares_of_episodes);
  row.Bind(valve.valve_id, since_ns);
  while (row.Step()) {
    double share = 0.0;
    bool notice = false;
    std::string label;
    std::int64_t hour = 0;
    int lasted = 0;
    row.Read(0, share, notice, label, hour, lasted);
    if (!label.empty() && label != "false") {
      continue;
    }
    valve.alarms += notice ? 0 : 1;
    if (share <= 1.0) {
      ++valve.others;
      valve.others_lasted += lasted;
    } else {
      valve.hours.push_back(
          {hour, label.empty() ? 1.0 : share, lasted, label.empty()});
    }
  }
  row.Reset();
}

}  // namespace

std::vector<HealthyHours> ReadHealthyHours(Database& database) {
  const std::vector<std::string> ids = HealthValves(database, "*");
  const std::int64_t each = std::max(
      kLeastPerValve, kMaxHours / std::max<std::int64_t>(std::ssize(ids), 1));
  std::vector<HealthyHours> valves;
  std::map<std::string, std::int64_t> last;
  std::int64_t newest = 0;
  for (const std::string& id : ids) {
    std::vector<HealthHour> hours;
    try {
      hours = NewestHealth(database, id, each);
    } catch (const DataError&) {
      HealthyHours& valve = valves.emplace_back();
      valve.valve_id = id;
      valve.damaged = true;
      continue;
    }
    if (hours.empty()) {
      continue;  // Nothing judges it.
    }
    const HealthHour& set = PresentSet(hours);
    HealthyHours valve;
    valve.valve_id = id;
    valve.model_hash = set.model_hash;
    valve.epoch = set.epoch;
    bool observed = false;  // Not by the audit of its loop alone.
    std::set<std::int64_t> days;
    std::int64_t first = set.hour;
    std::int64_t others = set.hour;  // Hour of another set.
    for (const HealthHour& hour : hours) {
      if (!IsOfSet(hour, set)) {
        others = hour.hour;
        continue;
      }
      if (hour.hour < others && others < first) {
        break;  // What the set was before another one.
      }
      first = hour.hour;
      observed = observed || hour.share > 0;
      if (IsHealthy(hour)) {
        valve.hours.push_back(
            {hour.hour, HealthHour::kShare * static_cast<double>(hour.share)});
        days.insert(hour.hour / kHoursPerDay);
      }
    }
    if (!observed) {
      continue;
    }
    valve.days = static_cast<int>(days.size());
    AddEpisodes(database, first * kNsPerHour, valve);
    last[id] = set.hour;
    newest = std::max(newest, set.hour);
    valves.push_back(std::move(valve));
  }
  std::erase_if(valves, [&](const HealthyHours& valve) {
    return !valve.damaged && last[valve.valve_id] < newest - kRecent;
  });
  return valves;
}

}  // namespace fdi::storage
