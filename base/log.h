#pragma once

#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace fdi {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

/// Receives the log lines of adapters, each `event key=value ...`. Called from
/// any thread. Programs own the logger behind it; an empty sink drops lines.
using LogSink = std::function<void(LogLevel, std::string_view)>;

/// "event key=value key=\"two words\"": quotes what has blanks or quotes.
std::string EventLine(
    std::string_view event,
    std::initializer_list<std::pair<std::string_view, std::string>> fields);

}  // namespace fdi
