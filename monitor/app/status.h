#pragma once

#include <cstdint>
#include <string>

#include "idl/endpoint.h"
#include "idl/wire.h"
#include "monitor/counters.h"
#include "monitor/valve_registry.h"

namespace fdi::monitor {

/// What a status message is made of.
struct StatusFacts {
  const Counters& counters;
  ValveCensus census;
  idl::SubscriberStatus samples;
  idl::PublisherStatus decisions;
  std::uint64_t waiting{0};  ///< Samples between intake and diagnosis.
  bool history_degraded{false};
  bool recording_degraded{false};
};

/// "host:pid"
std::string MonitorName();

/// Counters, gauges and health. Monitor, software and stamps are the caller's.
idl::MonitorStatusMessage StatusOf(const StatusFacts& facts);

/// "monitor_status received=1 ...": what is not zero.
std::string StatusLine(const idl::MonitorStatusMessage& status);

}  // namespace fdi::monitor
