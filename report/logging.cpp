#include "report/logging.h"

#include <memory>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "base/printable.h"

namespace fdi::report {
namespace {

spdlog::level::level_enum ToSpdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

}  // namespace

LogSink MakeStderrSink(LogLevel minimum) {
  auto logger = std::make_shared<spdlog::logger>(
      "fdi", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %v",
                      spdlog::pattern_time_type::utc);
  logger->set_level(ToSpdlog(minimum));
  // Flushed per line: the last line before a crash matters most.
  logger->flush_on(spdlog::level::debug);
  return [logger](LogLevel level, std::string_view line) {
    const std::string text = Printable(line);  // Prevents forged lines.
    logger->log(ToSpdlog(level), spdlog::string_view_t(text));
  };
}

}  // namespace fdi::report
