#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>

namespace fdi::monitor {

inline constexpr std::int64_t kSecond = 1'000'000'000;  ///< ns

/// Threads of this process.
inline std::size_t ThreadCount() {
  using std::filesystem::directory_iterator;
  return static_cast<std::size_t>(std::distance(
      directory_iterator("/proc/self/task"), directory_iterator{}));
}

}  // namespace fdi::monitor
