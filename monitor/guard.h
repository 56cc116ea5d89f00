#pragma once

#include <exception>
#include <string>
#include <string_view>
#include <utility>

#include "base/printable.h"
#include "monitor/counters.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Runs `call` for a part of the monitor that diagnosis and journal do not
/// need: its exceptions are counted and logged, and go no further.
template <typename Call>
void Guarded(Counters& counters, ThrottledLog& log, std::string_view part,
             Call&& call) {
  try {
    std::forward<Call>(call)();
  } catch (const std::exception& error) {
    counters.Add(Counter::kPartFailures);
    log.Report(
        LogId::kPartFailed, "part_failed",
        [&, reason = std::string(error.what())] {
          return "part=" + LogValue(part) + " reason=" + LogValue(reason);
        },
        LogLevel::kError);
  }
}

}  // namespace fdi::monitor
