#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/records/service_records.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Inserts stretches, or updates stored ones to their current length. Call
/// within a transaction; idempotent.
void StoreShadow(Database& history,
                 std::span<const ShadowDifference> stretches);

/// Settings of ListShadow().
struct ShadowFilter {
  std::string valve_glob{"*"};  ///< Shell pattern: * ? [...].
  std::string candidate{};      ///< NAME or NAME@VERSION; empty: any.
  std::int64_t since_ns{std::numeric_limits<std::int64_t>::min()};
  std::int64_t until_ns{std::numeric_limits<std::int64_t>::max()};
  std::int64_t limit{0};  ///< Only the newest ones; 0: all.
};

/// The stretches that begin in the filter's period, oldest first.
std::vector<ShadowDifference> ListShadow(Database& history,
                                         const ShadowFilter& filter = {});

}  // namespace fdi::storage
