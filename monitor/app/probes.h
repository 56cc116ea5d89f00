#pragma once

#include <functional>
#include <string>

#include "monitor/app/metrics_page.h"
#include "monitor/http/http_server.h"

namespace fdi::monitor {

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

/// Where the pages come from; called by threads of the server.
struct ProbeSources {
  std::function<std::string()> metrics;
  std::function<Readiness()> readiness;
};

/// /metrics; /healthz: 200 while all threads get on; /readyz: 200 while there
/// are models, databases and a publisher. Else 503; the body, JSON, says why.
HttpServer::Pages ProbePages(const Heartbeat& heartbeat, ProbeSources sources);

}  // namespace fdi::monitor
