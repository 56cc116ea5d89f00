#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "idl/endpoint.h"
#include "idl/wire.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/pipeline.h"
#include "monitor/valve_registry.h"

namespace fdi::monitor {

/// What a status message and a page of metrics are made of.
struct StatusFacts {
  const Counters& counters;
  ValveCensus census;
  idl::SubscriberStatus samples;
  idl::PublisherStatus decisions;
  Pipeline::Backlog waiting;
  bool history_degraded{false};
  bool recording_degraded{false};
  std::vector<std::string_view> stalled;  ///< Threads.
};

/// "host:pid"
std::string MonitorName();

/// Counters, gauges and health. Monitor, software and stamps are the caller's.
idl::MonitorStatusMessage StatusOf(const StatusFacts& facts);

/// One line for a service manager, without what changes all the time.
std::string ManagerLine(const idl::MonitorStatusMessage& status);

/// "a,b"
std::string Joined(const std::vector<std::string_view>& words);

/// "monitor_status received=1 ...": what is not zero.
std::string StatusLine(const idl::MonitorStatusMessage& status);

}  // namespace fdi::monitor
