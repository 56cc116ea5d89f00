#pragma once

#include <cstdint>

namespace fdi::monitor {

/// What the kernel says of this process; 0 where it does not say.
struct ProcessFacts {
  double cpu_s{0.0};  ///< User and system.
  std::uint64_t resident_bytes{0};
  std::uint64_t open_descriptors{0};
};

ProcessFacts ReadProcessFacts();

}  // namespace fdi::monitor
