#pragma once

#include <chrono>
#include <string_view>

#include "base/log.h"

namespace fdi::report {

/// Writes `text` to stderr as far as its reader takes it within `patience`, so
/// that nobody who stops reading holds the program up.
/// @returns whether it took all of it.
bool WriteToStderr(std::string_view text, std::chrono::milliseconds patience =
                                              std::chrono::seconds(1));

/// A sink to stderr: one line each, preceded by UTC time and level. Thread
/// safe. It never waits: while the reader of stderr does not read (a stopped
/// pager, Ctrl-S), lines are dropped, and counted by the line
/// `log_lines_dropped lines=N` once it reads again.
LogSink MakeStderrSink(LogLevel minimum);

}  // namespace fdi::report
