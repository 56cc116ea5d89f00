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
#include "monitor/app/pair.h"
#include "monitor/app/share_watch.h"
#include "monitor/console/admission.h"
#include "monitor/console/live_stream.h"
#include "monitor/counters.h"
#include "monitor/heartbeat.h"
#include "monitor/http/http_server.h"
#include "monitor/pipeline.h"
#include "storage/database/data_directory.h"

// How the monitor is: on the bus, in the log, over HTTP.

namespace fdi::monitor {

/// What the status on the bus and the page of metrics are made of, as of now.
struct StatusFacts {
  const Counters& counters;
  ValveCensus census;
  idl::SubscriberStatus samples;
  idl::DatagramCounts datagrams;       ///< Of all participants.
  std::uint64_t refused_participants;  ///< By the one that takes samples.
  idl::PublisherStatus decisions;
  Journal::Backlog journal;
  std::size_t recorder_backlog{0};
  bool history_degraded{false};
  bool recording_degraded{false};
  std::vector<std::string_view> stalled;  ///< Threads.
  std::optional<Pair::Status> pair{};     ///< If there is one.
  ContestedValves contested{};
};

/// All that is counted and measured, the counters first.
std::vector<Measure> MeasuresOf(const StatusFacts& facts);

/// Measures with a name, and health. Monitor, software and stamps are the
/// caller's.
idl::MonitorStatusMessage StatusOf(const StatusFacts& facts);

/// "host:pid"
std::string MonitorName();

/// One line for a service manager, without what changes all the time.
std::string ManagerLine(const idl::MonitorStatusMessage& status);

/// "a,b"
std::string Joined(const std::vector<std::string_view>& words);

/// "monitor_status received=1 ...": what is not zero.
std::string StatusLine(const idl::MonitorStatusMessage& status);

/// A thread that has not got on for so long is reported as stalled: longer than
/// a database may keep it waiting.
inline constexpr std::chrono::seconds kStallLimit{10};

/// What a monitor needs to be of use.
struct Readiness {
  std::size_t model_sets{0};
  bool databases{false};  ///< Take what is to be stored.
  int publishers{0};      ///< Of samples.

  bool ready() const { return model_sets > 0 && databases && publishers > 0; }
};

/// What the page of metrics says beside the status.
struct MetricsFacts {
  std::string software;
  std::int64_t started_ns{0};  ///< UTC.
  storage::DataDirectory data;
  std::vector<Heartbeat::Member> threads;
  std::optional<console::StreamCounts> streams{};  ///< If there is a console.
  std::uint64_t board_bytes{0};                    ///< Of the console.
  console::AdmissionCounts admissions{};           ///< Of the console.
  HttpServer::Counts requests{};
};

/// All that is counted, in the text format of Prometheus.
std::string MetricsPage(const StatusFacts& status, const MetricsFacts& facts);

/// Where the pages come from; called by threads of the server.
struct ProbeSources {
  std::function<std::string()> metrics;
  std::function<Readiness()> readiness;
};

/// Probes have a thread of their own, so that nothing that asks for metrics
/// makes a sound service look dead.
HttpServerOptions ProbeServer(const HttpAddress& address,
                              const std::vector<std::string>& names);

/// /metrics; /healthz: 200 while all threads get on; /readyz: 200 while there
/// are models, databases and a publisher. Else 503; the body, JSON, says why.
HttpServer::Pages ProbePages(const Heartbeat& heartbeat, ProbeSources sources);

}  // namespace fdi::monitor
