// Routes for maintenance planners: the work list, and months of a valve.
#include "planner/page/console_routes.h"

#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <string>

#include <httplib.h>

#include "base/mutex.h"
#include "base/time_units.h"
#include "planner/work_list.h"
#include "planner/work_report.h"
#include "report/findings/finding.h"
#include "storage/history/foreign_history.h"
#include "storage/history/health.h"

namespace fdi::planner {
namespace {

using console::Api;
using console::Json;
using console::Parameter;
using console::TimeParameter;

constexpr std::int64_t kCacheNs = 60'000'000'000;

std::vector<HealthLimit> LimitsOf(const httplib::Request& request) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < request.get_param_value_count("limit"); ++i) {
    texts.push_back(request.get_param_value("limit", i));
  }
  return ParseLimits(texts);
}

// The last work list that was requested.
struct ListCache {
  Mutex mutex;
  std::string query GUARDED_BY(mutex);
  std::int64_t read_ns GUARDED_BY(mutex){0};
  std::optional<Json> document GUARDED_BY(mutex);
};

// Without the audit of stored runs, which takes long.
Json ReadList(ListCache& cache, const Api& api,
              const httplib::Request& request) {
  std::string query = "?";
  for (const auto& [name, value] : request.params) {
    query += name + "=" + value + "&";
  }
  const std::int64_t now_ns = api.sources.utc_now_ns();
  const MutexLock lock(cache.mutex);
  if (!cache.document || query != cache.query ||
      now_ns >= cache.read_ns + kCacheNs || now_ns < cache.read_ns) {
    WorkQuery work;
    work.now_ns = now_ns;
    work.valve_glob = Parameter(request, "valve").value_or("*");
    work.since_ns = TimeParameter(request, "since_ms",
                                  now_ns - findings::kPeriodDays * kNsPerDay);
    work.discipline = Parameter(request, "discipline").value_or("");
    work.limits = LimitsOf(request);
    work.software = api.sources.software;
    if (!api.sources.plant_history) {
      work.loops = LoopsOf(api.sources.models);
      work.repairs = RepairsOf(api.sources.models);
    }
    for (const console::ValveState& valve : api.board.Valves(false)) {
      if (valve.models && valve.quality == Quality::kLive &&
          valve.silence == monitor::Silence::kNone) {
        work.judged_now.push_back(valve.id);
      }
    }
    const auto history = api.History();
    Json list = WorkList(history.get(), api.texts, work);
    list["note"] = console::TextOrNull(storage::TakeNote(*history));
    cache.document = std::move(list);
    cache.query = query;
    cache.read_ns = now_ns;
  }
  return *cache.document;
}

// One array per quantity, as charts need them; all have the same length.
Json ColumnsJson(const std::vector<HealthHour>& hours,
                 const report::FaultTexts& texts) {
  Json columns;
  for (const char* key :
       {"t_ms", "seen_h", "live_h", "alarm_h", "auto_h", "open_h", "shut_h",
        "d0", "travel_strokes", "path_strokes", "reversals", "slip_jumps",
        "turns", "steps", "exceeded", "status", "epoch"}) {
    columns[key] = Json::array();
  }
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    columns[std::string(loop::FigureName(static_cast<loop::Figure>(i)))] =
        Json::array();
  }
  // If an hour lacks a channel, for example because the model set was
  // different, its columns have nulls.
  std::map<std::string, Json> channels;
  const auto fill = [&channels](std::size_t size) {
    for (auto& [signal, channel] : channels) {
      for (const char* key : {"mean", "rms", "percent"}) {
        while (channel[key].size() < size) {
          channel[key].push_back(nullptr);
        }
      }
    }
  };
  const Json rows = HealthHoursJson(hours, texts);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (auto& [key, column] : columns.items()) {
      column.push_back(key == "t_ms" ? console::Ms(hours[i].hour * kNsPerHour)
                                     : rows[i][key]);
    }
    for (const Json& channel : rows[i]["channels"]) {
      Json& columns_of = channels[channel["signal"]];
      columns_of["signal"] = channel["signal"];
      columns_of["unit"] = channel["unit"];
      fill(i);
      for (const char* key : {"mean", "rms", "percent"}) {
        columns_of[key].push_back(channel[key]);
      }
    }
    fill(i + 1);
  }
  columns["channels"] = Json::array();
  for (auto& [signal, columns_of] : channels) {
    columns["channels"].push_back(std::move(columns_of));
  }
  return columns;
}

Json Health(const Api& api, const httplib::Request& request) {
  const std::string valve_id = request.matches[1];
  const std::int64_t now_ns = api.sources.utc_now_ns();
  const std::int64_t since_ns = TimeParameter(
      request, "since_ms", now_ns - findings::kPeriodDays * kNsPerDay);
  const bool hourly =
      console::IntegerParameter(request, "hourly", 0, 0, 1) == 1;
  const auto limits = LimitsOf(request);
  const auto history = api.History();
  const std::vector<HealthHour> hours =
      history->Health({valve_id, since_ns, now_ns + kNsPerHour});
  Json json{{"valve", valve_id}, {"step", hourly ? "hour" : "day"}};
  json.update(ColumnsJson(hourly ? hours : DaysOf(hours), api.texts));
  json["trends"] = TrendsJson(TrendsOf(hours, limits));
  json["note"] = console::TextOrNull(storage::TakeNote(*history));
  return json;
}

}  // namespace

std::vector<console::Route> ConsoleRoutes(
    const std::vector<storage::CauseGroup>& groups) {
  Json list = Json::array();
  for (const storage::CauseGroup& group : groups) {
    list.push_back({{"name", group.name}, {"valves", group.valve_globs}});
  }
  const auto cache = std::make_shared<ListCache>();
  return {
      {"/api/v1/groups",
       [answer = Json{{"groups", std::move(list)}}](
           const Api&, const httplib::Request&) { return answer; }},
      {"/api/v1/worklist",
       [cache](const Api& api, const httplib::Request& request) {
         return ReadList(*cache, api, request);
       }},
      {"/api/v1/worklist.csv", nullptr,
       [cache](const Api& api, const httplib::Request& request) {
         std::ostringstream csv;
         WorkListReport(ReadList(*cache, api, request)).PrintCsv(csv);
         return console::File{"text/csv; charset=utf-8", "worklist.csv",
                              csv.str()};
       }},
      {"/api/v1/worklist.html", nullptr,
       [cache](const Api& api, const httplib::Request& request) {
         std::ostringstream html;
         WorkListPage(ReadList(*cache, api, request))
             .PrintHtml(html, kListTitle, {true, true});
         return console::File{"text/html; charset=utf-8", "", html.str(), true};
       }},
      {"/api/v1/valves/(.+)/health", Health}};
}

}  // namespace fdi::planner
