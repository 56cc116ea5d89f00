#include "monitor/log_limit.h"

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace fdi::monitor {
namespace {

using Clock = std::chrono::steady_clock;

class Limit {
 public:
  explicit Limit(const LogLimitOptions& options) : options_(options) {}

  /// @returns whether the line is to be shown.
  /// @param not_shown how many before it were not.
  bool Admit(std::string_view line, std::uint64_t& not_shown) {
    const std::string event(line.substr(0, line.find(' ')));
    const Clock::time_point now = Clock::now();
    const std::lock_guard lock(mutex_);
    Window& window = windows_[event];
    if (window.shown == 0 || now - window.begin >= options_.interval) {
      window.begin = now;
      window.shown = 0;
    }
    if (window.shown >= options_.lines) {
      ++window.not_shown;
      return false;
    }
    ++window.shown;
    not_shown = std::exchange(window.not_shown, 0);
    return true;
  }

 private:
  struct Window {
    Clock::time_point begin;
    int shown{0};
    std::uint64_t not_shown{0};
  };

  LogLimitOptions options_;
  std::mutex mutex_;
  std::map<std::string, Window> windows_;
};

}  // namespace

LogSink LimitLog(LogSink sink, const LogLimitOptions& options) {
  return [sink = std::move(sink), limit = std::make_shared<Limit>(options)](
             LogLevel level, std::string_view line) {
    std::uint64_t not_shown = 0;
    if (!sink || !limit->Admit(line, not_shown)) {
      return;
    }
    if (not_shown == 0) {
      sink(level, line);
    } else {
      sink(level, std::string(line)
                      .append(" not_shown=")
                      .append(std::to_string(not_shown)));
    }
  };
}

}  // namespace fdi::monitor
