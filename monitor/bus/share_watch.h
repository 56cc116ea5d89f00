#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "diagnosis/records/monitor_share.h"
#include "idl/endpoint.h"
#include "monitor/throttled_log.h"

namespace fdi::monitor {

/// Valves that another monitor takes, too.
struct ContestedValves {
  std::size_t count{0};
  std::string example;  ///< Id of the first.
  std::string monitor;  ///< Another monitor that takes it.
};

/// The valves among `valves` that a monitor of `others` takes as well.
/// @param own the monitor itself, which is ignored among `others`.
ContestedValves FindContested(const MonitorShare& own,
                              const std::vector<MonitorShare>& others,
                              const std::vector<std::string>& valves);

/// Announces which share of the plant this monitor takes, receives the shares
/// of the others, and reports valves that two of them take. One thread unless
/// noted.
class ShareWatch {
 public:
  /// @throws ConfigError if the glob does not fit the wire;
  /// idl::TransportError.
  ShareWatch(idl::Participant& participant, MonitorShare own,
             ThrottledLog& log);

  /// Call about once a second. @param valves returns the valves seen so far;
  /// called only if another monitor's share may overlap.
  void Tick(const std::function<std::vector<std::string>()>& valves);
  /// As of the last Tick(). Thread safe.
  ContestedValves contested() const {
    const MutexLock lock(mutex_);
    return contested_;
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct PeerShare {
    MonitorShare share;
    Clock::time_point at;
  };

  const MonitorShare own_;
  ThrottledLog& log_;
  idl::Publisher<MonitorShare> out_;
  idl::Subscriber<MonitorShare> in_;
  std::map<std::string, PeerShare> peers_;  // By monitor.
  mutable Mutex mutex_;
  ContestedValves contested_ GUARDED_BY(mutex_);
};

}  // namespace fdi::monitor
