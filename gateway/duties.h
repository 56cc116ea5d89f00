#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/log.h"
#include "base/mutex.h"
#include "monitor/http/http_server.h"
#include "monitor/throttled_log.h"

namespace fdi::gateway {

/// A line of the metrics page.
struct Metric {
  std::string name;  ///< Without "fdi_gateway_"; "_total" marks a counter.
  std::string help;
  std::uint64_t value{0};
};

/// The duties of a service to its host: tells systemd that it is ready and
/// alive, and serves its metrics.
class Duties {
 public:
  /// @param address for /metrics and /healthz, "[ADDRESS:]PORT"; empty: none.
  /// @throws ConfigError; std::runtime_error if it cannot listen there.
  explicit Duties(const std::string& address);

  void Ready(const std::string& status);
  /// Call at least once a second. Once a second it takes the figures.
  /// @param tags a JSON document for /tags; null: none.
  /// @returns whether a second has passed.
  bool Tick(const std::function<std::vector<Metric>()>& metrics,
            const std::function<std::string()>& tags = {});

 private:
  std::chrono::steady_clock::time_point ticked_{};
  Mutex mutex_;
  std::string metrics_ GUARDED_BY(mutex_);
  std::string tags_ GUARDED_BY(mutex_);
  std::unique_ptr<monitor::HttpServer> server_;  // Last: uses the others.
};

/// A log in which one thing is said at most once a minute, and at most 10 000
/// things, in lines of at most 1 KiB, so that no flood of bad input fills the
/// disk or the memory.
class CalmLog {
 public:
  explicit CalmLog(LogSink log) : log_(std::move(log)) {}

  /// @param about what the line is of: a tag, a topic.
  void Warn(
      std::string_view event, const std::string& about,
      std::initializer_list<std::pair<std::string_view, std::string>> fields);

 private:
  LogSink log_;
  // Each event has its own, so that names that somebody makes up silence one.
  std::map<std::string, monitor::LogLimit> limits_;
};

}  // namespace fdi::gateway
