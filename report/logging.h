#pragma once

#include "base/log.h"

namespace fdi::report {

/// A sink to stderr: one line each, preceded by UTC time and level. Thread
/// safe. It never waits: while the reader of stderr does not read (a stopped
/// pager, Ctrl-S), lines are dropped, and counted by the line
/// `log_lines_dropped lines=N` once it reads again.
LogSink MakeStderrSink(LogLevel minimum);

}  // namespace fdi::report
