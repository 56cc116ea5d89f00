// What a maintenance planner asks for: the work list, months of a valve.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>

#include <httplib.h>

#include "diagnosis/error.h"
#include "monitor/console/api.h"
#include "monitor/planner/health_view.h"
#include "monitor/planner/read_work.h"
#include "storage/cli/time_text.h"
#include "storage/health_rows.h"
#include "storage/history_reader.h"

namespace fdi::console {
namespace {

constexpr std::int64_t kNsPerDay = 86'400'000'000'000;
constexpr std::int64_t kNsPerHour = 3'600'000'000'000;
constexpr std::int64_t kDays = 90;  // unless asked for otherwise
constexpr std::int64_t kMostRows = 1000;

// Months of all valves take a while to read: what was asked for last is told
// again for a minute.
class WorkListCache {
 public:
  explicit WorkListCache(const Api& api) : api_(api) {}

  std::vector<planner::WorkRow> Get(const httplib::Request& request) {
    const std::string asked = KeyOf(request);
    const std::int64_t now_ns = api_.sources.utc_now_ns();
    const std::lock_guard lock(mutex_);
    if (asked != asked_ || now_ns >= read_ns_ + kKeptNs || now_ns < read_ns_) {
      rows_ = Read(request, now_ns);
      asked_ = asked;
      read_ns_ = now_ns;
    }
    return rows_;
  }

 private:
  static constexpr std::int64_t kKeptNs = 60'000'000'000;

  static std::string KeyOf(const httplib::Request& request) {
    std::string key = "?";
    for (const auto& [name, value] : request.params) {
      key += name + "=" + value + "&";
    }
    return key;
  }

  std::vector<planner::WorkRow> Read(const httplib::Request& request,
                                     std::int64_t now_ns) const {
    planner::WorkQuery query;
    query.options.now_ns = now_ns;
    query.valve_glob = Parameter(request, "valve").value_or("*");
    query.since_ns =
        TimeParameter(request, "since_ms", now_ns - kDays * kNsPerDay);
    query.top = static_cast<std::size_t>(
        IntegerParameter(request, "top", 10, 1, kMostRows));
    query.discipline = Parameter(request, "discipline").value_or("");
    if (!query.discipline.empty()) {
      planner::RequireDiscipline(query.discipline);
    }
    for (std::size_t i = 0; i < request.get_param_value_count("limit"); ++i) {
      query.limits.push_back(
          monitor::ParseHealthLimit(request.get_param_value("limit", i)));
    }
    if (query.limits.empty()) {
      query.limits = planner::DefaultLimits();
    }
    storage::HistoryReader history(api_.sources.history);
    return planner::ReadWorkList(history, api_.texts, query);
  }

  const Api& api_;
  std::mutex mutex_;
  std::string asked_;
  std::int64_t read_ns_{0};
  std::vector<planner::WorkRow> rows_;
};

// One array per quantity, as charts take them.
Json ColumnsJson(const std::vector<HealthHour>& hours) {
  const Json rows = planner::HealthHoursJson(hours)["hours"];
  Json columns{{"t_ms", Json::array()}};
  for (const char* key : {"seen_h", "live_h", "alarm_h", "open_h", "shut_h",
                          "d0", "travel_strokes", "reversals", "epoch"}) {
    columns[key] = Json::array();
  }
  std::map<std::string, Json> channels;
  for (const Json& row : rows) {
    for (const Json& channel : row["channels"]) {
      channels[channel["signal"]]["unit"] = channel["unit"];
    }
  }
  for (const Json& row : rows) {
    columns["t_ms"].push_back(row["hour_ms"]);
    for (auto& [key, column] : columns.items()) {
      if (key != "t_ms") {
        column.push_back(row[key]);
      }
    }
    for (auto& [signal, columns_of] : channels) {
      const auto& list = row["channels"];
      const auto found = std::find_if(
          list.begin(), list.end(),
          [&](const Json& channel) { return channel["signal"] == signal; });
      for (const char* key : {"mean", "rms", "percent"}) {
        columns_of[key].push_back(found == list.end() ? Json() : (*found)[key]);
      }
    }
  }
  columns["channels"] = Json::array();
  for (auto& [signal, columns_of] : channels) {
    Json channel{{"signal", signal}};
    channel.update(columns_of);
    columns["channels"].push_back(std::move(channel));
  }
  return columns;
}

Json TrendsJson(const std::vector<HealthHour>& hours,
                const httplib::Request& request) {
  std::vector<monitor::HealthLimit> limits;
  for (std::size_t i = 0; i < request.get_param_value_count("limit"); ++i) {
    limits.push_back(
        monitor::ParseHealthLimit(request.get_param_value("limit", i)));
  }
  if (limits.empty()) {
    limits = planner::DefaultLimits();
  }
  Json trends = Json::array();
  for (const monitor::HealthLimit& limit : limits) {
    const auto series = SeriesOf(hours, limit);
    trends.push_back(planner::ForecastJson(
        {limit, Forecast(series, limit), series.flow_unit}));
  }
  return trends;
}

Json Health(const Api& api, const httplib::Request& request) {
  const std::string valve_id = request.matches[1];
  const std::int64_t now_ns = api.sources.utc_now_ns();
  const std::int64_t since_ns =
      TimeParameter(request, "since_ms", now_ns - kDays * kNsPerDay);
  const bool hourly = IntegerParameter(request, "hourly", 0, 0, 1) == 1;
  storage::HistoryReader history(api.sources.history);
  const std::vector<HealthHour> hours = storage::ReadHealth(
      history.database(), {valve_id, since_ns, now_ns + kNsPerHour});
  Json json{{"valve", valve_id}, {"step", hourly ? "hour" : "day"}};
  json.update(ColumnsJson(hourly ? hours : planner::DaysOf(hours)));
  json["trends"] = TrendsJson(hours, request);
  return json;
}

}  // namespace

void AddPlannerRoutes(httplib::Server& server, const Api& api) {
  const auto cache = std::make_shared<WorkListCache>(api);
  server.Get(
      "/api/v1/worklist",
      Answering([cache](const httplib::Request& request, httplib::Response&) {
        return planner::WorkListJson(cache->Get(request));
      }));
  server.Get(
      "/api/v1/worklist.csv",
      AnsweringFile([cache](const httplib::Request& request) {
        std::ostringstream csv;
        planner::WriteWorkListCsv(csv, cache->Get(request));
        return FileAnswer{"text/csv; charset=utf-8", "worklist.csv", csv.str()};
      }));
  server.Get(
      "/api/v1/valves/(.+)/health",
      Answering([&api](const httplib::Request& request, httplib::Response&) {
        return Health(api, request);
      }));
}

}  // namespace fdi::console
