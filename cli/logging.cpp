#include "cli/logging.h"

#include <memory>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

namespace fdi::cli {
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

// A line is `event key=value key="two words"`: one word up to the first blank,
// then pairs that scripts split at blanks outside quotes.
bool NeedsQuotes(const std::string& value) {
  return value.empty() || value.find_first_of(" \t\n\"=") != std::string::npos;
}

std::string Quoted(const std::string& value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
    }
    text += c == '\n' ? ' ' : c;
  }
  return text + '"';
}

}  // namespace

LogSink MakeStderrSink(LogLevel minimum) {
  auto logger = std::make_shared<spdlog::logger>(
      "fdi", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %v",
                      spdlog::pattern_time_type::utc);
  logger->set_level(ToSpdlog(minimum));
  // Each line at once: the last one before a crash is the one that matters.
  logger->flush_on(spdlog::level::debug);
  return [logger](LogLevel level, std::string_view line) {
    logger->log(ToSpdlog(level),
                spdlog::string_view_t(line.data(), line.size()));
  };
}

std::string EventLine(
    std::string_view event,
    std::initializer_list<std::pair<std::string_view, std::string>> fields) {
  std::string line(event);
  for (const auto& [key, value] : fields) {
    line += ' ';
    line += key;
    line += '=';
    line += NeedsQuotes(value) ? Quoted(value) : value;
  }
  return line;
}

}  // namespace fdi::cli
