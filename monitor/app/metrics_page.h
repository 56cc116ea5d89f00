#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/app/status.h"
#include "monitor/console/stream_hub.h"
#include "monitor/heartbeat.h"

namespace fdi::monitor {

/// Size of a database and of its write-ahead log; 0 if it is not there.
struct DatabaseFacts {
  std::string_view database;  ///< "history", ...
  std::uint64_t bytes{0};
  std::uint64_t wal_bytes{0};
};

/// @param path of the database.
DatabaseFacts FactsOf(std::string_view database,
                      const std::filesystem::path& path);

/// What the console is at.
struct ConsoleLoad {
  console::StreamCounts streams;
  std::uint64_t board_bytes{0};
};

/// What metrics say beside the status.
struct MetricsFacts {
  std::string software;
  std::int64_t started_ns{0};  ///< UTC.
  std::vector<DatabaseFacts> databases;
  std::vector<Heartbeat::Member> threads;
  std::optional<ConsoleLoad> console;  ///< If there is one.
};

/// All that is counted, in the text format of Prometheus.
std::string MetricsPage(const StatusFacts& status, const MetricsFacts& facts);

}  // namespace fdi::monitor
