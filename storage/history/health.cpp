#include "storage/history/health.h"

#include <cstdint>
#include <utility>

#include "base/time_units.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;

namespace {

HealthHour Unpacked(const Statement& row, int column, HealthHour hour) {
  hour.live_ms = row.Int64(column);
  UnpackHealth(row.Blob(column + 1), hour);
  return hour;
}

// An hour that was stored with other channels under the same hash cannot be
// added to: the newer part replaces it.
HealthHour Sum(const HealthHour& stored, const HealthHour& part) {
  if (stored.channels != part.channels) {
    return part;
  }
  HealthHour sum = stored;
  sum.Add(part);
  return sum;
}

}  // namespace

void StoreHealth(Database& database, std::span<const HealthHour> hours) {
  Statement old = database.Prepare(sql::health_hour);
  Statement row = database.Prepare(sql::put_health_hour);
  for (const HealthHour& part : hours) {
    HealthHour key;
    key.valve_id = part.valve_id;
    key.hour = part.hour;
    key.model_hash = part.model_hash;
    key.epoch = part.epoch;
    old.Bind(key.valve_id, key.hour, key.model_hash, key.epoch);
    const HealthHour sum =
        old.Step() ? Sum(Unpacked(old, 0, std::move(key)), part) : part;
    old.Reset();
    const std::vector<std::byte> bytes = PackHealth(sum);
    row.Bind(sum.valve_id, sum.hour, sum.model_hash, sum.epoch, sum.live_ms,
             std::span<const std::byte>(bytes))
        .Run();
  }
}

std::int64_t HourFrom(std::int64_t stamp_ns) {
  // ⌈stamp / 1 h⌉: division rounds towards zero, which is already up for a
  // negative stamp, whose remainder is not positive.
  return stamp_ns / kNsPerHour + (stamp_ns % kNsPerHour > 0 ? 1 : 0);
}

namespace {

std::vector<HealthHour> ReadHours(Statement& row, const std::string& valve_id) {
  std::vector<HealthHour> hours;
  while (row.Step()) {
    HealthHour hour;
    hour.valve_id = valve_id;
    row.Read(0, hour.hour, hour.model_hash, hour.epoch);
    hours.push_back(Unpacked(row, 3, std::move(hour)));
  }
  return hours;
}

}  // namespace

std::vector<HealthHour> ReadHealth(Database& database,
                                   const HealthFilter& filter) {
  Statement row = database.Prepare(sql::health_hours);
  row.Bind(filter.valve_id, HourFrom(filter.since_ns),
           HourFrom(filter.until_ns));
  return ReadHours(row, filter.valve_id);
}

std::vector<HealthHour> NewestHealth(Database& database,
                                     const std::string& valve_id,
                                     std::int64_t most) {
  Statement row = database.Prepare(sql::newest_hours);
  row.Bind(valve_id, most);
  return ReadHours(row, valve_id);
}

std::vector<std::string> HealthValves(Database& database,
                                      const std::string& glob) {
  Statement next = database.Prepare(sql::next_health_valve);
  std::vector<std::string> valves;
  std::string last;
  // Each step is one look into the primary key, so the costs grow with the
  // number of valves, not with that of their hours.
  while (next.Bind(last).Step() && !next.IsNull(0)) {
    last = next.Text(0);
    if (GlobMatches(glob, last)) {
      valves.push_back(last);
    }
  }
  return valves;
}

}  // namespace fdi::storage
