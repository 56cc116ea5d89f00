#include "storage/health_rows.h"

#include "storage/health_codec.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

// The first hour that begins at `stamp_ns` or later.
std::int64_t HourFrom(std::int64_t stamp_ns) {
  return stamp_ns / kHourNs + (stamp_ns % kHourNs > 0 ? 1 : 0);
}

HealthHour Unpacked(const Statement& row, int column, HealthHour hour) {
  hour.live_ms = row.Int64(column);
  UnpackHealth(row.Blob(column + 1), hour);
  return hour;
}

// What was stored by a program of other channels under the same hash cannot be
// added to: the newer part stands.
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
  Statement old = database.Prepare(
      "SELECT live_ms, bytes FROM health_hour "
      "WHERE valve_id = ? AND hour = ? AND model_hash = ? AND epoch = ?");
  Statement row = database.Prepare(
      "INSERT INTO health_hour (valve_id, hour, model_hash, epoch, live_ms, "
      "bytes) VALUES (?, ?, ?, ?, ?, ?) ON CONFLICT DO UPDATE SET "
      "live_ms = excluded.live_ms, bytes = excluded.bytes");
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

std::vector<HealthHour> ReadHealth(Database& database,
                                   const HealthFilter& filter) {
  Statement row = database.Prepare(
      "SELECT hour, model_hash, epoch, live_ms, bytes FROM health_hour "
      "WHERE valve_id = ? AND hour >= ? AND hour < ? "
      "ORDER BY hour, epoch, model_hash");
  row.Bind(filter.valve_id, HourFrom(filter.since_ns),
           HourFrom(filter.until_ns));
  std::vector<HealthHour> hours;
  while (row.Step()) {
    HealthHour hour;
    hour.valve_id = filter.valve_id;
    hour.hour = row.Int64(0);
    hour.model_hash = row.Uint64(1);
    hour.epoch = static_cast<std::uint32_t>(row.Int64(2));
    hours.push_back(Unpacked(row, 3, std::move(hour)));
  }
  return hours;
}

std::vector<std::string> HealthValves(Database& database,
                                      const std::string& glob) {
  // Skips from valve to valve along the key.
  Statement next = database.Prepare(
      "SELECT min(valve_id) FROM health_hour WHERE valve_id > ?");
  Statement match = database.Prepare("SELECT ? GLOB ?");
  std::vector<std::string> valves;
  std::string last;
  while (next.Bind(last).Step() && !next.IsNull(0)) {
    last = next.Text(0);
    if (match.Bind(last, glob).Step() && match.Bool(0)) {
      valves.push_back(last);
    }
  }
  return valves;
}

}  // namespace fdi::storage
