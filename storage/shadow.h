#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/history_coverage.h"

namespace fdi::storage {

/// A stretch in which a candidate model set said something else about a valve
/// than the active one; a row of shadow_difference. Known by valve, source,
/// start and candidate.
struct ShadowDifference {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::int64_t from_ns{0};  ///< Stamps of the first and the last sample.
  std::int64_t to_ns{0};
  std::int64_t samples{0};
  std::string active_set;  ///< NAME@VERSION
  std::uint64_t active_hash{0};
  std::string active_state;  ///< NORMAL, DETECTED, ISOLATED
  std::string active_fault;  ///< Names joined by |; empty: none isolated.
  std::string candidate_set;
  std::uint64_t candidate_hash{0};
  std::string candidate_state;
  std::string candidate_fault;
};

/// Adds stretches, or makes those that are there as long as they are now, and
/// replaces the accumulators of those valves; one transaction, on the disk on
/// return. Twice is a no-op.
void KeepShadow(Database& history, std::span<const ShadowDifference> stretches,
                std::span<const StoredAccumulator> accumulators);

/// As KeepShadow() got them last.
std::vector<StoredAccumulator> ShadowAccumulators(Database& history);

/// Settings of ListShadow().
struct ShadowFilter {
  std::string valve_glob{"*"};  ///< As in a shell: * ? [...].
  std::string candidate{};      ///< NAME or NAME@VERSION; empty: any.
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
  std::int64_t limit{0};  ///< The newest so many; 0: all.
};

/// The stretches that begin in the filter's time, oldest first.
std::vector<ShadowDifference> ListShadow(Database& history,
                                         const ShadowFilter& filter = {});

}  // namespace fdi::storage
