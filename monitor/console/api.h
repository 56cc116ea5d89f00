#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "monitor/console/alarm_book.h"
#include "monitor/console/live_board.h"
#include "monitor/console/live_feed.h"
#include "monitor/console/stored_models.h"
#include "monitor/console/stream_hub.h"
#include "storage/cli/fault_texts.h"

namespace httplib {
class Server;
struct Request;
struct Response;
}  // namespace httplib

namespace fdi::console {

/// How the monitor is.
struct MonitorFacts {
  std::string_view health;  ///< "OK", "DEGRADED"
  std::vector<std::pair<std::string, std::uint64_t>> counters;
  std::uint64_t open_episodes{0};
};

/// What the console needs of the monitor; called by any thread.
struct ConsoleSources {
  std::filesystem::path history;
  std::filesystem::path models;
  std::string software;
  std::int64_t started_ns{0};
  std::function<MonitorFacts()> facts;
  std::function<std::int64_t()> utc_now_ns;
};

/// What answers are made of; all outlive the server.
struct Api {
  ConsoleSources sources;
  LiveBoard& board;
  StreamHub& hub;
  LiveFeed& feed;
  AlarmBook& alarms;
  StoredModels& models;
  const cli::FaultTexts& texts;
  std::string token;     ///< Empty: read-only.
  std::string instance;  ///< Differs after a restart.

  /// FaultNamer of the catalogue, for the middle of a sentence.
  std::string PlainName(std::string_view fault) const;
};

/// /api/v1/status, faults, valves, valves/ID/trend.
void AddLiveRoutes(httplib::Server& server, const Api& api);
/// /api/v1/stream
void AddStreamRoute(httplib::Server& server, const Api& api);
/// /api/v1/alarms, history, statistics, shelf
void AddHistoryRoutes(httplib::Server& server, const Api& api);
/// /api/v1/episodes/ID, ID.csv
void AddEpisodeRoutes(httplib::Server& server, const Api& api);
/// /api/v1/episodes/ID.svg, ID.png
void AddPictureRoutes(httplib::Server& server, const Api& api);
/// What changes the history, for who has the token.
void AddActionRoutes(httplib::Server& server, const Api& api);
/// /api/v1/worklist, worklist.csv, valves/ID/health
void AddPlannerRoutes(httplib::Server& server, const Api& api);

using Handler =
    std::function<void(const httplib::Request&, httplib::Response&)>;
using Answer = std::function<Json(const httplib::Request&, httplib::Response&)>;

/// A handler that sends what `answer` returns. What it throws becomes
/// {"error"} with 400 for ConfigError and std::invalid_argument, 404 for
/// NotFoundError, 503 for a history that is busy, else 500.
Handler Answering(Answer answer);

/// A file to be kept, made of what the history tells.
struct FileAnswer {
  std::string type;
  std::string name;
  std::string body;
};
/// As Answering().
Handler AnsweringFile(
    std::function<FileAnswer(const httplib::Request&)> answer);

void SendJson(httplib::Response& response, const Json& json);
void SendError(httplib::Response& response, int status,
               const std::string& what);

/// The parameter of the query, or nothing if it is not there or empty.
std::optional<std::string> Parameter(const httplib::Request& request,
                                     const char* name);
/// @throws ConfigError naming the parameter and the range.
std::int64_t IntegerParameter(const httplib::Request& request, const char* name,
                              std::int64_t otherwise, std::int64_t minimum,
                              std::int64_t maximum);
/// ms since 1970 as ns. @throws ConfigError
std::int64_t TimeParameter(const httplib::Request& request, const char* name,
                           std::int64_t otherwise_ns);

}  // namespace fdi::console
