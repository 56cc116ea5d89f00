#include "monitor/throttled_log.h"

#include <memory>

namespace fdi::monitor {
namespace {

constexpr std::size_t kMaxKinds = 10'000;

std::string IdName(LogId id) {
  return "M" + std::to_string(static_cast<int>(id));
}

std::string WithNotShown(std::string line, std::uint64_t not_shown) {
  return not_shown == 0
             ? line
             : line.append(" not_shown=").append(std::to_string(not_shown));
}

}  // namespace

std::string LogLine(LogId id, std::string_view event, std::string_view fields) {
  std::string line(event);
  return line.append(" id=").append(IdName(id)).append(" ").append(fields);
}

// The first lines of an interval are shown and the others counted. Their number
// is told by the first line that is shown again.
bool LogLimit::Admit(std::string_view kind, std::uint64_t& not_shown) {
  const auto now = std::chrono::steady_clock::now();
  const MutexLock lock(mutex_);
  auto place = windows_.find(kind);
  if (place == windows_.end()) {
    if (windows_.size() >= kMaxKinds && now - swept_ >= options_.interval) {
      swept_ = now;
      std::erase_if(windows_, [&](const auto& window) {
        return now - window.second.begin >= options_.interval;
      });
    }
    if (windows_.size() >= kMaxKinds) {
      return false;
    }
    place = windows_.emplace(std::string(kind), Window{}).first;
  }
  Window& window = place->second;
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

void ThrottledLog::Report(LogId id, std::string_view event,
                          const std::function<std::string()>& fields,
                          LogLevel level) {
  std::uint64_t not_shown = 0;
  if (limit_.Admit(IdName(id), not_shown)) {
    Line(level, WithNotShown(LogLine(id, event, fields()), not_shown));
  }
}

void ThrottledLog::Line(LogLevel level, std::string_view line) const {
  if (sink_) {
    sink_(level, line);
  }
}

// The kind of a line is its first word, the name of the event.
LogSink LimitLog(LogSink sink, const LogLimitOptions& options) {
  return [sink = std::move(sink), limit = std::make_shared<LogLimit>(options)](
             LogLevel level, std::string_view line) {
    std::uint64_t not_shown = 0;
    if (sink && limit->Admit(line.substr(0, line.find(' ')), not_shown)) {
      sink(level, WithNotShown(std::string(line), not_shown));
    }
  };
}

}  // namespace fdi::monitor
