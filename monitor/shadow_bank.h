#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "monitor/shadow_valve.h"
#include "monitor/throttled_log.h"
#include "monitor/valve_directory.h"

namespace fdi::monitor {

/// Settings of ShadowBank.
struct ShadowOptions {
  std::shared_ptr<const ModelSet> candidate;  ///< Null: none runs.
  std::string valve_glob{"*"};
  ShadowLimits limits;
};

/// Totals since the start; valves stand for now. Thread safe.
struct ShadowCounts {
  std::array<std::atomic<std::uint64_t>, 3> samples{};  ///< By ShadowOutcome.
  std::array<std::atomic<std::int64_t>, kShadowFitCount> valves{};
  std::atomic<std::uint64_t> recorded{0};  ///< Stretches to be stored.
  std::atomic<std::uint64_t> left_out{0};  ///< Stretches beyond the bound.
};

/// A candidate model set beside the active ones, on all valves that it fits:
/// its decisions are compared and go nowhere. Costs one engine per valve.
///
/// The diagnosis thread, except where noted.
class ShadowBank {
 public:
  /// @throws DataError if the candidate is not usable.
  ShadowBank(ShadowOptions options, ThrottledLog& log);

  /// What an earlier session kept; of another candidate it counts for nothing.
  void Restore(std::vector<Accumulator> accumulators);

  void Step(const ValveDirectory::Entry& valve, const Sample& sample,
            const ValveOutcome& active);
  void EndStream(const ValveDirectory::Entry& valve);

  /// What is to be kept of all valves since the last call.
  void TakeTo(Checkpoint& checkpoint);

  const ModelSet& candidate() const { return parts_.plan->models(); }
  /// Thread safe.
  const ShadowCounts& counts() const { return counts_; }

 private:
  struct Valve {
    bool chosen{false};
    bool listed{false};  // In counts_.valves.
    ShadowFit fit{ShadowFit::kNoActive};
    std::unique_ptr<ShadowValve> shadow;
  };
  Valve& At(const ValveDirectory::Entry& valve);
  void NoteFit(const std::string& valve_id, Valve& valve);

  ShadowOptions options_;
  ThrottledLog& log_;
  EngineParts parts_;
  std::vector<Valve> valves_;  // By index of the directory.
  std::unordered_map<std::string, Accumulator> saved_;
  ShadowCounts counts_;
};

}  // namespace fdi::monitor
