#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/quality_count.h"
#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// Samples of a valve on one day (UTC) by quality, to be added to those that
/// are stored.
struct CoverageCount {
  std::string valve_id;
  std::int64_t day{0};   ///< Since 1970-01-01.
  double period_s{1.0};  ///< Of the samples.
  QualityCount samples;
};

/// The slow accumulators of a valve: what ValveEngine::Save() gave.
struct StoredAccumulator {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t model_hash{0};
  std::int64_t stamp_ns{0};  ///< Of the last sample.
  std::vector<std::byte> bytes;
};

/// Time of one valve with one quality, over the days of a filter.
struct CoverageTime {
  std::string valve_id;
  std::string quality;  ///< QualityName().
  std::int64_t samples{0};
  double hours{0.0};
};

/// Within a transaction.
void StoreCoverage(Database& database, std::span<const CoverageCount> counts);
void StoreAccumulators(Database& database,
                       std::span<const StoredAccumulator> accumulators);

std::vector<StoredAccumulator> ReadAccumulators(Database& database);

/// Of the valves and the days (UTC) that the filter touches, by valve.
std::vector<CoverageTime> ReadCoverage(Database& database,
                                       const EpisodeFilter& filter);

}  // namespace fdi::storage
