#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "diagnosis/records/monitor_share.h"
#include "idl/endpoint.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Valves that another monitor takes, too, without being of our pair.
struct ContestedValves {
  std::size_t count{0};
  std::string example;  ///< Id of the first.
  std::string monitor;  ///< That takes it, too.
};

/// Those of `valves` that a monitor of `others` takes, too.
/// @param own a monitor of the same pair, and itself, contest nothing.
ContestedValves FindContested(const MonitorShare& own,
                              const std::vector<MonitorShare>& others,
                              const std::vector<std::string>& valves);

/// Says which share of the plant this monitor takes, hears those of others, and
/// reports valves that two of them take. One thread, if nothing else is said.
class ShareWatch {
 public:
  /// @throws ConfigError if the glob does not fit the wire;
  /// idl::TransportError.
  ShareWatch(idl::Participant& participant, MonitorShare own,
             ThrottledLog& log);

  /// About once a second. @param valves that this monitor has seen; asked for
  /// only where another one takes samples, too.
  void Tick(const std::function<std::vector<std::string>()>& valves);
  /// As of the last Tick(). Any thread.
  ContestedValves contested() const {
    const std::lock_guard lock(mutex_);
    return contested_;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Heard {
    MonitorShare share;
    Clock::time_point at;
  };

  const MonitorShare own_;
  ThrottledLog& log_;
  idl::Publisher<MonitorShare> out_;
  idl::Subscriber<MonitorShare> in_;
  std::map<std::string, Heard> heard_;  // By monitor.
  mutable std::mutex mutex_;
  ContestedValves contested_;  // Guarded by mutex_.
};

}  // namespace fdi::monitor
