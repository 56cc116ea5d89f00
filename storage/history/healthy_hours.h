#pragma once

#include <vector>

#include "diagnosis/decision/alarm_budget.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// The healthy hours of all valves that are judged, each with the model set and
/// the equipment that it has now: hours of which at least nine tenths were
/// judged without an open episode. Of all valves together the newest 200 000
/// are read, but 200 of each at least; 200 000 take 0.2 s and support return
/// periods of two million hours. Left out are valves that no observers judge,
/// and those whose last hour is more than a week older than the newest one of
/// all valves. A valve with an hour that cannot be read has none, so all its
/// episodes are alarms, and those of the other valves are weighed.
/// @throws SqliteError
std::vector<HealthyHours> ReadHealthyHours(Database& database);

}  // namespace fdi::storage
