#include "storage/history_coverage.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kDayNs = 86'400'000'000'000;

}  // namespace

void StoreCoverage(Database& database, std::span<const CoverageCount> counts) {
  Statement row = database.Prepare(
      "INSERT INTO coverage_day (valve_id, day, quality, samples, seconds) "
      "VALUES (?, ?, ?, ?, ?) ON CONFLICT (valve_id, day, quality) DO UPDATE "
      "SET samples = samples + excluded.samples, "
      "seconds = seconds + excluded.seconds");
  for (const CoverageCount& count : counts) {
    for (std::size_t i = 0; i < kQualityCount; ++i) {
      const auto quality = static_cast<Quality>(i);
      const std::uint64_t samples = count.samples[quality];
      if (samples != 0) {
        row.Bind(count.valve_id, count.day, QualityName(quality), samples,
                 static_cast<double>(samples) * count.period_s)
            .Run();
      }
    }
  }
}

void StoreAccumulators(Database& database,
                       std::span<const StoredAccumulator> accumulators) {
  Statement row = database.Prepare(
      "INSERT INTO accumulator (valve_id, source_id, model_hash, stamp_ns, "
      "bytes) VALUES (?, ?, ?, ?, ?) ON CONFLICT (valve_id) DO UPDATE SET "
      "source_id = excluded.source_id, model_hash = excluded.model_hash, "
      "stamp_ns = excluded.stamp_ns, bytes = excluded.bytes");
  for (const StoredAccumulator& accumulator : accumulators) {
    row.Bind(accumulator.valve_id, accumulator.source_id,
             accumulator.model_hash, accumulator.stamp_ns,
             std::span<const std::byte>(accumulator.bytes))
        .Run();
  }
}

std::vector<StoredAccumulator> ReadAccumulators(Database& database) {
  Statement row = database.Prepare(
      "SELECT valve_id, source_id, model_hash, stamp_ns, bytes "
      "FROM accumulator ORDER BY valve_id");
  std::vector<StoredAccumulator> accumulators;
  while (row.Step()) {
    accumulators.push_back(
        {row.Text(0), row.Uint64(1), row.Uint64(2), row.Int64(3), row.Blob(4)});
  }
  return accumulators;
}

std::vector<CoverageTime> ReadCoverage(Database& database,
                                       const EpisodeFilter& filter) {
  Statement row = database.Prepare(
      "SELECT valve_id, quality, sum(samples), sum(seconds) / 3600.0 "
      "FROM coverage_day WHERE valve_id GLOB ?1 AND day >= ?2 AND day <= ?3 "
      "GROUP BY valve_id, quality ORDER BY valve_id, sum(seconds) DESC");
  row.Bind(filter.valve_glob, filter.since_ns / kDayNs,
           filter.until_ns / kDayNs);
  std::vector<CoverageTime> times;
  while (row.Step()) {
    times.push_back({row.Text(0), row.Text(1), row.Int64(2), row.Double(3)});
  }
  return times;
}

}  // namespace fdi::storage
