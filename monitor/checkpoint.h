#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/health_hour.h"
#include "diagnosis/quality_count.h"
#include "diagnosis/records/service_records.h"

namespace fdi::monitor {

/// `newer` on top of `older`: time and health add up, accumulators and
/// stretches that grew are replaced.
Checkpoint Merged(Checkpoint older, Checkpoint newer);

/// `newer` behind `older`; of the same stretch the newer one stands. What is
/// beyond 100 000, as while the disk is full, is left out: these are notes, no
/// evidence.
std::vector<ShadowDifference> Merged(std::vector<ShadowDifference> older,
                                     std::vector<ShadowDifference> newer);

/// The time of one valve by quality and day, until it is taken.
class CoverageBook {
 public:
  void Add(std::int64_t stamp_ns, Quality quality, std::uint64_t samples = 1);
  /// Appends all that was added since the last call.
  void TakeInto(const std::string& valve_id, double period_s,
                std::vector<CoverageDay>& days);

 private:
  struct Day {
    std::int64_t day;
    QualityCount samples;
  };
  std::vector<Day> days_;  // Mostly one.
};

}  // namespace fdi::monitor
