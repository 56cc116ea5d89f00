#pragma once

#include "base/log.h"

namespace fdi::report {

/// A sink to stderr: one line each, preceded by UTC time and level. Thread
/// safe.
LogSink MakeStderrSink(LogLevel minimum);

}  // namespace fdi::report
