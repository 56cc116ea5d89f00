#pragma once

#include <cstdint>
#include <string>

namespace fdi::storage {

/// For what deletes by age: that cannot be undone, and the clock may stand
/// years ahead, after a dead battery or a restored snapshot.
/// @param newest_ns when the newest of `what` came; 0: there is nothing.
/// @throws DataError if that is more than a month ago.
void RequireSaneClock(const std::string& what, std::int64_t newest_ns);

}  // namespace fdi::storage
