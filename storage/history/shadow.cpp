#include "storage/history/shadow.h"

#include <algorithm>

#include "storage/database/record.h"
#include "storage/history/sql.h"

namespace fdi::storage {

template <>
struct EnumText<State> {
  static constexpr auto name = StateName;
  static constexpr auto last = State::kIsolated;
};

void StoreShadow(Database& history,
                 std::span<const ShadowDifference> stretches) {
  if (stretches.empty()) {
    return;
  }
  Statement& row = history.Cached(InsertSql<ShadowDifference>(
      "shadow_difference",
      "ON CONFLICT (valve_id, source_id, from_ns, candidate_hash) DO UPDATE "
      "SET to_ns = excluded.to_ns, samples = excluded.samples "
      "WHERE excluded.to_ns > to_ns",
      " active_fault candidate_fault "));
  for (const ShadowDifference& stretch : stretches) {
    BindRecord(row, stretch).Run();
  }
}

std::vector<ShadowDifference> ListShadow(Database& history,
                                         const ShadowFilter& filter) {
  Statement rows = history.Prepare(
      SelectSql<ShadowDifference>(history_sql::shadow_differences));
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
            filter.candidate, filter.limit > 0 ? filter.limit : -1);
  auto stretches = ReadRecords<ShadowDifference>(rows);
  std::reverse(stretches.begin(), stretches.end());
  return stretches;
}

}  // namespace fdi::storage
