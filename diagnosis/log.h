#pragma once

#include <functional>
#include <string_view>

namespace fdi {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

/// Where adapters send their lines, each `event key=value ...`. Called from any
/// thread. Programs own the logger behind it; an empty sink drops the line.
using LogSink = std::function<void(LogLevel, std::string_view)>;

}  // namespace fdi
