#pragma once

#include <functional>
#include <string_view>

namespace fdi {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

/// Receives the log lines of adapters, each `event key=value ...`. Called from
/// any thread. Programs own the logger behind it; an empty sink drops lines.
using LogSink = std::function<void(LogLevel, std::string_view)>;

}  // namespace fdi
