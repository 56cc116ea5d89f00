#include "storage/shadow_retention.h"

#include <thread>

#include "storage/database.h"
#include "storage/history_schema.h"

namespace fdi::storage {
namespace {

// Counts what ended before into `result`.
void Count(Database& database, std::int64_t before_ns, PruneResult& result) {
  Statement row = database.Prepare(
      "SELECT count(*), min(from_ns), max(from_ns) FROM shadow_difference"
      " WHERE to_ns < ?");
  row.Bind(before_ns).Step();
  result.deleted = row.Int64(0);
  result.from_ns = row.OptionalInt64(1);
  result.to_ns = row.OptionalInt64(2);
}

}  // namespace

PruneResult PruneShadow(const std::filesystem::path& path,
                        const RetentionLimits& limits) {
  constexpr std::int64_t kRowsAtOnce = 1000;
  Database database(
      path, HistorySchema(),
      limits.dry_run ? Access::kReader : Access::kOccasionalWriter);
  PruneResult result;
  result.bytes_before = database.UsedBytes();
  result.bytes_after = result.bytes_before;
  const std::int64_t before_ns = limits.before_ns.value_or(0);
  Count(database, before_ns, result);
  for (std::int64_t gone = 0; !limits.dry_run && gone < result.deleted;
       gone += kRowsAtOnce) {
    Transaction transaction(database);
    database.Run(
        "DELETE FROM shadow_difference WHERE difference_id IN (SELECT"
        " difference_id FROM shadow_difference WHERE to_ns < ?"
        " ORDER BY from_ns LIMIT ?)",
        before_ns, kRowsAtOnce);
    transaction.Commit();
    std::this_thread::sleep_for(limits.pause);
    result.bytes_after = database.UsedBytes();
  }
  return result;
}

}  // namespace fdi::storage
