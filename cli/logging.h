#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "diagnosis/log.h"

namespace fdi::cli {

/// A sink to stderr: one line each, preceded by UTC time and level. Thread
/// safe.
LogSink MakeStderrSink(LogLevel minimum);

/// "event key=value key=\"two words\"": quotes what has blanks or quotes.
std::string EventLine(
    std::string_view event,
    std::initializer_list<std::pair<std::string_view, std::string>> fields);

}  // namespace fdi::cli
