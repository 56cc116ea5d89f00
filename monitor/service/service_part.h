#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.h"
#include "monitor/counters.h"
#include "monitor/sinks.h"
#include "report/json_output.h"
#include "storage/database/data_directory.h"

namespace fdi::monitor {

/// State of the monitor.
struct MonitorFacts {
  std::string_view health;  ///< "OK", "DEGRADED"
  std::vector<std::pair<std::string, std::uint64_t>> counters;
  std::uint64_t open_episodes{0};
};

/// The means that the service lends to its parts. They outlive the parts.
/// Thread safe.
struct PartContext {
  storage::DataDirectory data;
  std::string software;
  std::int64_t started_ns{0};
  LogSink log;
  std::function<MonitorFacts()> facts;
  /// Runs `step`; its exceptions are counted and logged (`part_failed`).
  std::function<void(std::string_view part, const std::function<void()>& step)>
      guard;
  /// Notifies whom --on-event names.
  std::function<void(const report::Json&)> notify;
  /// Valves that the history knows, and when it last heard of each.
  std::vector<std::pair<std::string, std::int64_t>> seen;
};

/// An optional part of the service, with threads of its own for which neither
/// diagnosis nor bus wait. The service calls each function from its main
/// thread, except OnCommitted() and AddMetrics(), which come from any.
class ServicePart {
 public:
  virtual ~ServicePart() = default;
  virtual std::string_view name() const = 0;  ///< In the log.
  /// Follows the valves; null: none.
  virtual ValveListener* listener() { return nullptr; }
  /// Called once, before the first sample. If it throws, Stop() and Close()
  /// follow all the same.
  virtual void Start(const PartContext& context) = 0;
  /// The valves with a model set of their own, at the start and after each
  /// change.
  virtual void OnAssigned(const std::vector<std::string>& /*valves*/) {}
  /// The event is in the history, or has to do without it. Must not block.
  virtual void OnCommitted(const FaultEvent& event, bool persisted) = 0;
  /// The end begins: takes no further clients. Does not block.
  virtual void Leave() {}
  /// Everything is in the history: does what is left to do with it.
  virtual void Stop() {}
  /// Ends all threads that call the context.
  virtual void Close() {}
  virtual void AddMetrics(Exposition& /*page*/) const {}
};

}  // namespace fdi::monitor
