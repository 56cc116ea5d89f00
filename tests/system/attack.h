#pragma once

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/system/honest_valve.h"

namespace fdi::monitor {

inline constexpr double kMaxMemory = 300.0;  // [MB]

/// Duration of each attack: FDI_ATTACK_SECONDS, or 3 s.
inline std::chrono::seconds AttackTime() {
  const char* asked = std::getenv("FDI_ATTACK_SECONDS");
  return std::chrono::seconds(asked == nullptr ? 3 : std::atoi(asked));
}

/// Where the computer does nothing else, which is said by FDI_ATTACK_SECONDS.
inline void ExpectPunctual(const HonestValve::Delays& delays) {
  if (std::getenv("FDI_ATTACK_SECONDS") != nullptr) {
    EXPECT_LE(delays.p99, 50.0);
  }
}

/// The most memory that the process ever had, according to the kernel [MB].
inline double PeakMemory(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string word; status >> word;) {
    if (word == "VmHWM:") {
      double kilobytes = 0.0;
      status >> kilobytes;
      return kilobytes / 1024.0;
    }
  }
  return 0.0;
}

}  // namespace fdi::monitor
