#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/health_hour.h"
#include "storage/database.h"

namespace fdi::storage {

/// Adds `hours` to those that are stored. Within a transaction.
void StoreHealth(Database& database, std::span<const HealthHour> hours);

/// Settings of ReadHealth().
struct HealthFilter {
  std::string valve_id;
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
};

/// The hours of one valve that begin in the window, by time.
std::vector<HealthHour> ReadHealth(Database& database,
                                   const HealthFilter& filter);

/// Valves that have any, by id; `glob` as in a shell.
std::vector<std::string> HealthValves(Database& database,
                                      const std::string& glob);

}  // namespace fdi::storage
