#pragma once

#include <vector>

#include "diagnosis/decision/alarm_budget.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// The healthy hours of all valves that are judged, each with the model set and
/// the equipment that it has now: hours of which at least nine tenths were
/// judged without an open episode. Of all valves together the newest 200 000
/// are read, which takes a second and supports return periods of two million
/// hours.
/// @throws SqliteError, DataError
std::vector<HealthyHours> ReadHealthyHours(Database& database);

}  // namespace fdi::storage
