#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/records/health_hour.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// The sums of an hour as bytes; health_codec.cpp has the format. Its key and
/// live_ms are separate columns.
std::vector<std::byte> PackHealth(const HealthHour& hour);

/// Decodes bytes from PackHealth() into `hour`, whose key is already set.
/// @throws DataError if the bytes are damaged or of a later format.
void UnpackHealth(std::span<const std::byte> bytes, HealthHour& hour);

/// Adds `hours` to the stored ones. Call within a transaction.
void StoreHealth(Database& database, std::span<const HealthHour> hours);

/// Settings of ReadHealth().
struct HealthFilter {
  std::string valve_id;
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
};

/// The first hour that begins at or after `stamp_ns`.
std::int64_t HourFrom(std::int64_t stamp_ns);

/// The hours of one valve that begin in the window, ordered by time.
std::vector<HealthHour> ReadHealth(Database& database,
                                   const HealthFilter& filter);

/// At most so many hours of one valve with a model set, newest first.
std::vector<HealthHour> NewestHealth(Database& database,
                                     const std::string& valve_id,
                                     std::int64_t most);

/// Ids of valves that have stored hours, sorted; `glob` is a shell pattern.
std::vector<std::string> HealthValves(Database& database,
                                      const std::string& glob);

}  // namespace fdi::storage
