#pragma once

#include <chrono>

#include "diagnosis/log.h"

namespace fdi::monitor {

/// Settings of LimitLog().
struct LogLimitOptions {
  int lines{100};  ///< Of one event, the first word of a line, per interval.
  std::chrono::milliseconds interval{10'000};
};

/// A sink before `sink` that holds back what is beyond the limit, whoever
/// writes it; the next line of the event that is shown says how many were not
/// (`not_shown=N`). Thread safe.
LogSink LimitLog(LogSink sink, const LogLimitOptions& options = {});

}  // namespace fdi::monitor
