#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/model/quality_count.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/records/fields.h"
#include "diagnosis/records/health_hour.h"

/// Records of a monitor other than episodes and samples.
namespace fdi {

/// A period in which a valve, or every valve if `valve_id` is empty, was not
/// diagnosed or not recorded.
struct DataGap {
  std::string valve_id;
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
  std::string reason;  ///< "stream" and others: docs/data.md.
};
/// Samples of one valve on one day by quality.
struct CoverageDay {
  std::string valve_id;
  std::int64_t day{0};   ///< UTC, days since 1970-01-01.
  double period_s{1.0};  ///< Between samples.
  QualityCount samples;
};

/// The slow accumulators of a valve's engine, as packed by ValveEngine::Save().
struct Accumulator {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t model_hash{0};
  std::int64_t stamp_ns{0};  ///< Stamp of the last sample.
  std::vector<std::byte> bytes;
};
/// State that a monitor stores for all valves every minute.
struct Checkpoint {
  std::vector<CoverageDay> coverage;      ///< Since the last checkpoint.
  std::vector<Accumulator> accumulators;  ///< One per live valve.
  std::vector<HealthHour> health;         ///< Since the last checkpoint.

  bool empty() const {
    return coverage.empty() && accumulators.empty() && health.empty();
  }
};

}  // namespace fdi

FDI_FIELDS(fdi::DataGap, valve_id, from_ns, to_ns, reason)

FDI_FIELDS(fdi::Accumulator, valve_id, source_id, model_hash, stamp_ns, bytes)
