#include "report/logging.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include <poll.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

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

// A log that nobody reads must not hold up the program. A line that stderr does
// not take at once is dropped and counted; the count comes before the next
// line.
class NeverWaitingSink : public spdlog::sinks::base_sink<std::mutex> {
 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (dropped_ > 0) {
      const std::string text =
          EventLine("log_lines_dropped", {{"lines", std::to_string(dropped_)}});
      spdlog::details::log_msg count(message.logger_name, spdlog::level::warn,
                                     text);
      if (Write(count)) {
        dropped_ = 0;
      }
    }
    if (dropped_ > 0 || !Write(message)) {
      ++dropped_;
    }
  }
  void flush_() override {}

 private:
  bool Write(const spdlog::details::log_msg& message) {
    spdlog::memory_buf_t line;
    formatter_->format(message, line);
    return WriteToStderr({line.data(), line.size()},
                         std::chrono::milliseconds(0));
  }

  std::uint64_t dropped_ = 0;
};

}  // namespace

// A pipe and a terminal that poll() calls writable take at least PIPE_BUF
// bytes.
bool WriteToStderr(std::string_view text, std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!text.empty()) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        until - std::chrono::steady_clock::now());
    pollfd stream{STDERR_FILENO, POLLOUT, 0};
    const int ready = poll(
        &stream, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (ready < 0 && errno == EINTR) {
      continue;
    }
    if (ready != 1 || (stream.revents & POLLOUT) == 0) {
      return false;
    }
    const ssize_t written = write(STDERR_FILENO, text.data(),
                                  std::min<std::size_t>(text.size(), PIPE_BUF));
    if (written <= 0) {
      return false;
    }
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

LogSink MakeStderrSink(LogLevel minimum) {
  auto logger = std::make_shared<spdlog::logger>(
      "fdi", std::make_shared<NeverWaitingSink>());
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %v",
                      spdlog::pattern_time_type::utc);
  logger->set_level(ToSpdlog(minimum));
  return [logger](LogLevel level, std::string_view line) {
    const std::string text = Printable(line);  // Prevents forged lines.
    logger->log(ToSpdlog(level), spdlog::string_view_t(text));
  };
}

}  // namespace fdi::report
