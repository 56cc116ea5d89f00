#include "monitor/throttled_log.h"

#include <utility>

namespace fdi::monitor {

std::string_view LogIdName(LogId id) {
  static constexpr std::array<std::string_view,
                              static_cast<std::size_t>(LogId::kCount_)>
      kNames{"M101", "M102", "M103", "M104", "M105", "M106", "M107", "M108",
             "M109", "M110", "M111", "M112", "M113", "M114", "M115", "M121",
             "M122", "M123", "M124", "M131", "M132", "M141", "M151"};
  return kNames[static_cast<std::size_t>(id)];
}

ThrottledLog::ThrottledLog(LogSink sink, std::chrono::milliseconds interval)
    : sink_(std::move(sink)), interval_(interval) {}

void ThrottledLog::Report(LogId id, std::string_view event,
                          const std::function<std::string()>& fields,
                          LogLevel level) {
  const Clock::time_point now = Clock::now();
  std::uint64_t left_out = 0;
  {
    const std::lock_guard lock(mutex_);
    Entry& entry = entries_[static_cast<std::size_t>(id)];
    if (entry.written && now - entry.last < interval_) {
      ++entry.left_out;
      return;
    }
    entry.written = true;
    entry.last = now;
    left_out = std::exchange(entry.left_out, 0);
  }
  std::string line(event);
  line.append(" id=").append(LogIdName(id)).append(" ").append(fields());
  if (left_out > 0) {
    line.append(" not_shown=").append(std::to_string(left_out));
  }
  Line(level, line);
}

void ThrottledLog::Line(LogLevel level, std::string_view line) const {
  if (sink_) {
    sink_(level, line);
  }
}

}  // namespace fdi::monitor
