#include "monitor/heartbeat.h"

namespace fdi::monitor {

std::vector<std::string_view> Heartbeat::StalledSince(TimePoint since) const {
  std::vector<std::string_view> stalled;
  for (const Member& member : members_) {
    if (member.pulse->last() <= since) {
      stalled.push_back(member.thread);
    }
  }
  return stalled;
}

bool Watchdog::Tell(TimePoint now) {
  if (now < next() || !heartbeat_.StalledSince(told_).empty()) {
    return false;
  }
  told_ = now;
  return true;
}

}  // namespace fdi::monitor
