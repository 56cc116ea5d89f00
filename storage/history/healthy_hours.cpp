#include "storage/history/healthy_hours.h"

#include <algorithm>
#include <set>
#include <string>

#include "base/time_units.h"
#include "storage/history/health.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;
namespace {

constexpr std::int64_t kMaxHours = 200'000;
constexpr double kJudged = 0.9;  // of an hour
constexpr std::int64_t kMsPerHour = 3'600'000;
constexpr std::int64_t kHoursPerDay = 24;

bool IsHealthy(const HealthHour& hour) {
  return hour.share > 0 && static_cast<double>(hour.live_ms - hour.alarm_ms) >=
                               kJudged * static_cast<double>(kMsPerHour);
}

// What a label calls a fault says nothing of a healthy valve.
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
  const std::int64_t each =
      kMaxHours / std::max<std::int64_t>(std::ssize(ids), 1);
  std::vector<HealthyHours> valves;
  for (const std::string& id : ids) {
    const std::vector<HealthHour> hours = NewestHealth(database, id, each);
    if (hours.empty()) {
      continue;  // Nothing judges it.
    }
    HealthyHours valve;
    valve.valve_id = id;
    std::set<std::int64_t> days;
    std::int64_t first = hours.front().hour;
    for (const HealthHour& hour : hours) {
      if (hour.model_hash != hours.front().model_hash ||
          hour.epoch != hours.front().epoch) {
        break;
      }
      first = hour.hour;
      if (IsHealthy(hour)) {
        valve.hours.push_back(
            {hour.hour, HealthHour::kShare * static_cast<double>(hour.share)});
        days.insert(hour.hour / kHoursPerDay);
      }
    }
    valve.days = static_cast<int>(days.size());
    AddEpisodes(database, first * kNsPerHour, valve);
    valves.push_back(std::move(valve));
  }
  return valves;
}

}  // namespace fdi::storage
