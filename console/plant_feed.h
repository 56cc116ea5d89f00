#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "console/api.h"
#include "idl/endpoint.h"

namespace fdi::console {

/// Feeds a board with what the monitors of a plant publish, and tells which of
/// them are silent. A valve belongs to the monitor that published its last
/// vector. A monitor is identified by its DDS participant, which sends both its
/// vectors and its status. One thread, except for monitors().
class PlantFeed {
 public:
  using Clock = std::chrono::steady_clock;
  /// A monitor publishes its status each second.
  static constexpr std::chrono::milliseconds kMonitorSilence{1800};
  /// After which a silent valve leaves the page; its alarms stay, they are the
  /// history's. A page that starts lists the valves of as long a time.
  static constexpr std::chrono::hours kForgetValve{30 * 24};

  explicit PlantFeed(LiveBoard& board) : board_(board) {}

  /// Learns what the arrays mean in vectors with the hash of `info`.
  std::shared_ptr<const ModelFacts> Add(const idl::ModelSetInfoMessage& info);
  void Add(const idl::DecisionMessage& message, const idl::Reception& reception,
           Clock::time_point now);
  /// A valve that does not send is listed, too.
  void Add(const idl::ValveStateMessage& state, const idl::Reception& reception,
           Clock::time_point now);
  void Add(const idl::MonitorStatusMessage& status,
           const idl::Reception& reception, Clock::time_point now);

  /// Marks as silent the valves that sent nothing for three of their periods
  /// and at least 3 s, or whose monitor is silent. Forgets valves after
  /// kForgetValve, monitors without valves after a minute of silence. Call
  /// several times a second.
  void Poll(Clock::time_point now);

  /// Ordered by name; thread safe.
  std::vector<MonitorLine> monitors() const;

 private:
  struct Monitor {
    MonitorLine line;
    Clock::time_point heard;
  };
  struct Valve {
    std::uint64_t participant{0};
    std::uint64_t source_id{0};
    std::uint64_t seq{0};
    Clock::time_point heard;
    Clock::duration patience{0};
    monitor::Silence silence{monitor::Silence::kNone};
  };
  MonitorLine& MarkAlive(const idl::Reception& reception, Clock::time_point now)
      REQUIRES(mutex_);
  void UpdateSilence(const std::string& valve_id, Valve& valve,
                     const Monitor& monitor, Clock::time_point now);

  LiveBoard& board_;
  std::map<std::uint64_t, std::shared_ptr<const ModelFacts>> models_;
  std::map<std::string, Valve> valves_;
  mutable Mutex mutex_;
  std::map<std::uint64_t, Monitor> monitors_
      GUARDED_BY(mutex_);  // By participant.
};

}  // namespace fdi::console
