#pragma once

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "storage/cli/stop_signals.h"

namespace fdi::simulator {

/// How fast samples leave: so many times real time, or as fast as they are
/// taken.
struct Speed {
  double factor{1.0};

  bool IsMax() const {
    return factor == std::numeric_limits<double>::infinity();
  }
};

/// Reads "1", "0.5", "60" or "max". @throws ConfigError naming these.
Speed ParseSpeed(std::string_view text);

/// Holds samples back until they are due: one of stamp s leaves (s - s0) /
/// factor after the first one. A gap in the stamps is a pause.
class Pacer {
 public:
  Pacer(Speed speed, cli::StopSignals& signals)
      : speed_(speed), signals_(signals) {}

  /// @returns false if a stop was requested.
  bool WaitUntilDue(std::int64_t stamp_ns);

 private:
  Speed speed_;
  cli::StopSignals& signals_;
  std::optional<std::int64_t> first_stamp_ns_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace fdi::simulator
