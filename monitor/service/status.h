#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/endpoint.h"
#include "idl/wire.h"
#include "monitor/bus/share_watch.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/http/http_server.h"
#include "monitor/pipeline.h"
#include "storage/database/data_directory.h"
#include "storage/history/alarm.h"

// The state of the monitor: on the bus, in the log, over HTTP.

namespace fdi::monitor {

/// Snapshot from which the status on the bus and the metrics page are made.
struct StatusFacts {
  const Counters& counters;
  ValveCensus census;
  idl::SubscriberStatus samples;
  idl::DatagramCounts datagrams;       ///< Summed over all participants.
  std::uint64_t refused_participants;  ///< By the intake participant.
  std::uint64_t refused_permissions;   ///< See idl::RefusedPermissions().
  idl::PublisherStatus decisions;
  Journal::Backlog journal;
  std::size_t recorder_backlog{0};
  bool history_degraded{false};
  bool recording_degraded{false};
  std::vector<std::string_view> stalled{};  ///< Names of threads.
  ContestedValves contested{};
};

/// All counters and gauges, the counters first.
std::vector<Measure> MeasuresOf(const StatusFacts& facts);

/// Named measures and health. The caller sets monitor, software and stamps.
idl::MonitorStatusMessage StatusOf(const StatusFacts& facts);

/// "host:pid"; with a random suffix in a pid namespace of its own (a
/// container). Another one with each call; MonitorName() is that of this
/// process.
std::string NewMonitorName();
std::string MonitorName();

/// One line for a service manager, without values that change all the time.
std::string ManagerLine(const idl::MonitorStatusMessage& status);

/// "monitor_status received=1 ...": the values that are not zero.
std::string StatusLine(const idl::MonitorStatusMessage& status);

/// A thread without progress for this long is reported as stalled. Longer than
/// a database may block it.
inline constexpr std::chrono::seconds kStallLimit{10};

/// The conditions for a monitor to be useful.
struct Readiness {
  std::size_t model_sets{0};
  bool databases{false};  ///< They accept writes.
  int publishers{0};      ///< Publishers of samples.

  bool ready() const { return model_sets > 0 && databases && publishers > 0; }
};

/// The additions of the metrics page to the status.
struct MetricsFacts {
  std::string software;
  std::int64_t started_ns{0};  ///< UTC.
  storage::DataDirectory data;
  std::vector<Heartbeat::Member> threads;
  /// Nothing: the history does not tell.
  std::optional<storage::AlarmCounts> alarms{};
};

/// All metrics in the Prometheus text format.
std::string MetricsPage(const StatusFacts& status, const MetricsFacts& facts);

/// Callbacks behind the pages; called by server threads.
struct ProbeSources {
  std::function<std::string()> metrics;
  std::function<Readiness()> readiness;
};

/// /metrics; /healthz: 200 while all threads make progress; /readyz: 200 while
/// there are models, databases and a publisher. Otherwise 503 with the reason
/// as JSON.
HttpServer::Pages ProbePages(const Heartbeat& heartbeat, ProbeSources sources);

}  // namespace fdi::monitor
