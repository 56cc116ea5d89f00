#include "storage/health_retention.h"

#include <algorithm>
#include <thread>

#include "storage/database.h"
#include "storage/health_rows.h"
#include "storage/history_schema.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

// Counts what is older than `hour` into `result`. @returns its bytes.
std::uintmax_t Count(Database& database, const std::string& valve,
                     std::int64_t hour, PruneResult& result) {
  Statement row = database.Prepare(
      "SELECT count(*), min(hour), max(hour), sum(length(bytes)) "
      "FROM health_hour WHERE valve_id = ? AND hour < ?");
  if (!row.Bind(valve, hour).Step() || row.Int64(0) == 0) {
    return 0;
  }
  result.deleted += row.Int64(0);
  const std::int64_t from_ns = row.Int64(1) * kHourNs;
  const std::int64_t to_ns = row.Int64(2) * kHourNs;
  result.from_ns = std::min(result.from_ns.value_or(from_ns), from_ns);
  result.to_ns = std::max(result.to_ns.value_or(to_ns), to_ns);
  return row.Uint64(3);
}

}  // namespace

PruneResult PruneHealth(const std::filesystem::path& path,
                        const RetentionLimits& limits) {
  Database database(
      path, HistorySchema(),
      limits.dry_run ? Access::kReader : Access::kOccasionalWriter);
  PruneResult result;
  result.bytes_before = database.UsedBytes();
  std::uintmax_t gone = 0;
  const std::int64_t hour = limits.before_ns ? *limits.before_ns / kHourNs : 0;
  for (const std::string& valve : HealthValves(database, "*")) {
    const std::uintmax_t bytes = Count(database, valve, hour, result);
    gone += bytes;
    if (bytes != 0 && !limits.dry_run) {
      Transaction transaction(database);
      database.Run("DELETE FROM health_hour WHERE valve_id = ? AND hour < ?",
                   valve, hour);
      transaction.Commit();
      std::this_thread::sleep_for(limits.pause);
    }
  }
  result.bytes_after =
      limits.dry_run ? result.bytes_before - std::min(gone, result.bytes_before)
                     : database.UsedBytes();
  return result;
}

}  // namespace fdi::storage
