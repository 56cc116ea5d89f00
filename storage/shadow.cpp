#include "storage/shadow.h"

#include <algorithm>

#include "diagnosis/error.h"

namespace fdi::storage {
namespace {

std::optional<std::string> Optional(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(text);
}

ShadowDifference ReadRow(const Statement& row) {
  return {row.Text(0),
          static_cast<std::uint64_t>(row.Int64(1)),
          row.Int64(2),
          row.Int64(3),
          row.Int64(4),
          row.Text(5),
          static_cast<std::uint64_t>(row.Int64(6)),
          row.Text(7),
          row.OptionalText(8).value_or(""),
          row.Text(9),
          static_cast<std::uint64_t>(row.Int64(10)),
          row.Text(11),
          row.OptionalText(12).value_or("")};
}

}  // namespace

void KeepShadow(Database& history, std::span<const ShadowDifference> stretches,
                std::span<const StoredAccumulator> accumulators) {
  Transaction transaction(history);
  Statement stretch = history.Prepare(
      "INSERT INTO shadow_difference (valve_id, source_id, from_ns, to_ns,"
      " samples, active_set, active_hash, active_state, active_fault,"
      " candidate_set, candidate_hash, candidate_state, candidate_fault)"
      " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"
      " ON CONFLICT (valve_id, source_id, from_ns, candidate_hash) DO UPDATE"
      " SET to_ns = excluded.to_ns, samples = excluded.samples"
      " WHERE excluded.to_ns > to_ns");
  for (const ShadowDifference& d : stretches) {
    stretch
        .Bind(d.valve_id, d.source_id, d.from_ns, d.to_ns, d.samples,
              d.active_set, d.active_hash, d.active_state,
              Optional(d.active_fault), d.candidate_set, d.candidate_hash,
              d.candidate_state, Optional(d.candidate_fault))
        .Run();
  }
  Statement accumulator = history.Prepare(
      "INSERT OR REPLACE INTO shadow_accumulator VALUES (?, ?, ?, ?, ?)");
  for (const StoredAccumulator& a : accumulators) {
    accumulator.Bind(a.valve_id, a.source_id, a.model_hash, a.stamp_ns, a.bytes)
        .Run();
  }
  transaction.Commit();
}

std::vector<StoredAccumulator> ShadowAccumulators(Database& history) {
  std::vector<StoredAccumulator> accumulators;
  Statement rows = history.Prepare(
      "SELECT valve_id, source_id, model_hash, stamp_ns, bytes"
      " FROM shadow_accumulator");
  while (rows.Step()) {
    accumulators.push_back({rows.Text(0),
                            static_cast<std::uint64_t>(rows.Int64(1)),
                            static_cast<std::uint64_t>(rows.Int64(2)),
                            rows.Int64(3), rows.Blob(4)});
  }
  return accumulators;
}

std::vector<ShadowDifference> ListShadow(Database& history,
                                         const ShadowFilter& filter) {
  Statement rows = history.Prepare(
      "SELECT valve_id, source_id, from_ns, to_ns, samples, active_set,"
      " active_hash, active_state, active_fault, candidate_set,"
      " candidate_hash, candidate_state, candidate_fault"
      " FROM shadow_difference WHERE valve_id GLOB ?1 AND from_ns >= ?2"
      " AND from_ns <= ?3 AND (?4 = '' OR candidate_set = ?4 OR"
      " substr(candidate_set, 1, length(?4) + 1) = ?4 || '@')"
      " ORDER BY from_ns DESC, difference_id DESC LIMIT ?5");
  rows.Bind(filter.valve_glob, filter.since_ns, filter.until_ns,
            filter.candidate, filter.limit > 0 ? filter.limit : -1);
  std::vector<ShadowDifference> stretches;
  while (rows.Step()) {
    stretches.push_back(ReadRow(rows));
  }
  std::reverse(stretches.begin(), stretches.end());
  return stretches;
}

}  // namespace fdi::storage
