#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string_view>

#include "base/log.h"
#include "report/json_output.h"

namespace fdi::monitor {

/// An optional part of the service that follows what history.db has committed,
/// with a connection and a thread of its own. Thread safe except for Start()
/// and Stop().
class HistoryFollower {
 public:
  virtual ~HistoryFollower() = default;
  virtual void Start() = 0;
  /// Further events are committed. Does not wait.
  virtual void Wake() = 0;
  /// Reads what is committed, then ends the thread.
  virtual void Stop() = 0;
};

/// What the service lends to a follower, and outlives it.
struct FollowerContext {
  std::filesystem::path history;
  LogSink log;
  /// Runs `step`; what it throws is counted and logged (`part_failed`).
  std::function<void(std::string_view part, const std::function<void()>& step)>
      guard;
  /// Notifies whom --on-event names.
  std::function<void(const report::Json&)> notify;
};

/// Empty: nothing follows.
using MakeFollower =
    std::function<std::unique_ptr<HistoryFollower>(const FollowerContext&)>;

}  // namespace fdi::monitor
