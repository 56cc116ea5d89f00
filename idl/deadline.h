#pragma once

#include <algorithm>
#include <chrono>

namespace fdi::idl {

/// `timeout` from now; a timeout without end is one of a year, so that nothing
/// overflows.
inline std::chrono::steady_clock::time_point DeadlineIn(
    std::chrono::milliseconds timeout) {
  const std::chrono::milliseconds longest = std::chrono::hours(24 * 365);
  return std::chrono::steady_clock::now() + std::min(timeout, longest);
}

}  // namespace fdi::idl
