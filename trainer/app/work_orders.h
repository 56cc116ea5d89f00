#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace fdi::trainer {

/// What was found when a valve was looked at.
struct WorkOrder {
  std::string valve;
  std::int64_t time_ns{0};  ///< UTC, or on the time axis of the records.
  int found{0};             ///< Fault; 0: nothing.
};

/// Reads work orders from a CSV file with the columns valve, time (RFC 3339,
/// UTC where no offset is given, or seconds) and found (a fault or `nothing`).
/// @returns them by valve and time.
/// @throws NotFoundError if there is no such file; DataError naming file, line
///   and reason.
std::vector<WorkOrder> ReadWorkOrders(const std::filesystem::path& file);

}  // namespace fdi::trainer
