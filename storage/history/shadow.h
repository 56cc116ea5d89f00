#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "diagnosis/records/service_records.h"
#include "storage/database/database.h"

namespace fdi::storage {

/// Adds stretches, or makes those that are there as long as they are now.
/// Within a transaction; twice is a no-op.
void StoreShadow(Database& history,
                 std::span<const ShadowDifference> stretches);

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
