#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/health_hour.h"
#include "diagnosis/quality_count.h"
#include "monitor/shadow_difference.h"

namespace fdi::monitor {

/// Samples of one valve on one day (UTC, days since 1970) by quality.
struct CoverageDay {
  std::string valve_id;
  std::int64_t day{0};
  double period_s{1.0};  ///< Of its samples.
  QualityCount samples;
};

/// What ValveEngine::Save() gave for a valve.
struct Accumulator {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t model_hash{0};
  std::int64_t stamp_ns{0};  ///< Of the last sample.
  std::vector<std::byte> bytes;
};

/// What is kept of all valves each minute.
struct Checkpoint {
  std::vector<CoverageDay> coverage;             ///< Since the one before.
  std::vector<Accumulator> accumulators;         ///< Of the live valves.
  std::vector<HealthHour> health;                ///< Since the one before.
  std::vector<ShadowDifference> shadow;          ///< New or longer since then.
  std::vector<Accumulator> shadow_accumulators;  ///< Of the candidate.

  bool empty() const {
    return coverage.empty() && accumulators.empty() && health.empty() &&
           shadow.empty() && shadow_accumulators.empty();
  }
};

/// `newer` on top of `older`: time and health add up, accumulators and
/// stretches that grew are replaced.
Checkpoint Merged(Checkpoint older, Checkpoint newer);

/// The time of one valve by quality and day, until it is taken.
class CoverageBook {
 public:
  void Add(std::int64_t stamp_ns, Quality quality, std::uint64_t samples = 1);
  /// Appends all that was added since the last call.
  void TakeTo(const std::string& valve_id, double period_s,
              std::vector<CoverageDay>& days);

 private:
  struct Day {
    std::int64_t day;
    QualityCount samples;
  };
  std::vector<Day> days_;  // Mostly one.
};

}  // namespace fdi::monitor
