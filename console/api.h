#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <semaphore>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "console/admission.h"
#include "console/alarm_book.h"
#include "console/live_board.h"
#include "console/live_stream.h"
#include "monitor/service/service_part.h"
#include "report/fault_texts.h"
#include "storage/models/models.h"

namespace httplib {
class Server;
struct Request;
struct Response;
}  // namespace httplib

namespace fdi::console {

using monitor::MonitorFacts;

/// A monitor whose valves the plant page shows.
struct MonitorLine {
  std::string name;  ///< "host:pid", as in MonitorStatus.
  std::string software;
  std::string health;       ///< "OK", ...; empty: no status has arrived yet.
  std::string text;         ///< Why it is not OK.
  std::uint64_t valves{0};  ///< Valves for which its vectors came last.
  std::int64_t heard_ns{0};
  bool silent{false};
};

/// The sources in the monitor that the console needs; called by any thread.
struct ConsoleSources {
  std::filesystem::path history;
  std::filesystem::path models;
  std::string software;
  std::int64_t started_ns{0};
  std::function<MonitorFacts()> facts;
  std::function<std::int64_t()> utc_now_ns;
  /// For the plant page, which shows several monitors and has no database of
  /// its own; `history` and `models` are then ignored.
  OpenHistory plant_history{};
  std::function<std::vector<MonitorLine>()> monitors{};
};

/// Answers from a history, and pictures, that are made at once; further
/// requests are answered 503 with Retry-After. A history may be on another host
/// that answers slowly, and a picture takes a program a second of a processor:
/// they hold up no other request.
inline constexpr int kHistoryPlaces = 8;
inline constexpr int kPicturePlaces = 2;

/// The sources of all responses; everything referenced outlives the server.
struct Api {
  ConsoleSources sources;
  LiveBoard& board;
  LiveStream& stream;
  AlarmBook& alarms;
  StoredModels& models;
  const report::FaultTexts& texts;
  Admission& access;
  std::string instance;  ///< Differs after a restart.
  std::stop_token stopping{};
  mutable std::counting_semaphore<> history_places{kHistoryPlaces};
  mutable std::counting_semaphore<> picture_places{kPicturePlaces};

  /// @throws storage::HistoryAwayError immediately while that of a plant is
  ///   away.
  std::unique_ptr<storage::History> History() const;
  /// Work noted of the valve by `valves repaired`; nothing on the page of a
  /// plant.
  std::vector<storage::ValveEvent> Repairs(const std::string& valve_id) const;
  /// Explain(), with the fault names of the catalogue.
  Json Words(const ModelFacts* facts, const TracePoint* point) const;
};

/// A file to download, or a page with its own style to look at.
struct File {
  std::string type;
  std::string name;
  std::string body;
  bool is_page{false};
};

/// A GET handler for paths that match a regular expression: JSON or a file.
struct Route {
  const char* path;
  std::function<Json(const Api&, const httplib::Request&)> json;
  std::function<File(const Api&, const httplib::Request&)> file{};
};

/// /api/v1/status, faults, valves, valves/ID/trend.
std::vector<Route> LiveRoutes();
/// /api/v1/alarms, history, statistics, shelf, episodes/ID with .csv .svg .png
/// .html.
std::vector<Route> HistoryRoutes();

/// Exceptions become {"error"} with 400 for ConfigError and
/// std::invalid_argument, 404 for NotFoundError, 503 for a history that is busy
/// or away, otherwise 500.
void AddRoutes(httplib::Server& server, const Api& api,
               std::span<const Route> routes);
/// /api/v1/stream
void AddStreamRoute(httplib::Server& server, const Api& api);
/// POST routes that change the history, where Admission permits it.
void AddActionRoutes(httplib::Server& server, const Api& api);

/// For a plant: {"monitors": [{"monitor", "host", "software", "health", "text",
/// "valves", "heard_ms", "silent"}], "history_away": {"since_ms", "reason"} or
/// null}. Otherwise null.
Json PlantJson(const Api& api);

/// [{"at_ms", "kind", "who", "note", "order"}] of those from `from_ns` on.
Json RepairsJson(const std::vector<storage::ValveEvent>& repairs,
                 std::int64_t from_ns);
/// Adds what was done within a trend to its marks.
void AddRepairs(const std::vector<storage::ValveEvent>& repairs,
                std::int64_t from_ns, std::int64_t to_ns, Json& marks);

void SendJson(httplib::Response& response, const Json& json);
void SendError(httplib::Response& response, int status,
               const std::string& what);
/// Runs `send`; exceptions are answered as in AddRoutes().
void Guarded(httplib::Response& response, const std::function<void()>& send);

/// The query parameter; nothing if it is missing or empty.
std::optional<std::string> Parameter(const httplib::Request& request,
                                     const char* name);
/// @throws ConfigError naming the parameter and the range.
std::int64_t IntegerParameter(const httplib::Request& request, const char* name,
                              std::int64_t otherwise, std::int64_t minimum,
                              std::int64_t maximum);
inline constexpr std::int64_t kNsPerMs = 1'000'000;
/// Milliseconds since 1970, converted to ns. @throws ConfigError
std::int64_t TimeParameter(const httplib::Request& request, const char* name,
                           std::int64_t otherwise_ns);

}  // namespace fdi::console
