// How the monitor and its valves are now.
#include <algorithm>

#include <httplib.h>

#include "diagnosis/error.h"
#include "monitor/console/api.h"

namespace fdi::console {
namespace {

constexpr double kStalePeriods = 3.0;
constexpr std::int64_t kNsPerS = 1'000'000'000;

Json Status(const Api& api) {
  const MonitorFacts facts = api.sources.facts();
  Json counters = Json::object();
  for (const auto& [name, value] : facts.counters) {
    counters[name] = value;
  }
  Json sets = Json::array();
  double period_s = 1.0;
  for (const auto& models : api.board.ModelSets()) {
    sets.push_back(ModelFactsJson(*models));
    period_s = std::max(period_s, models->period_s);
  }
  std::uint64_t live = 0;
  std::uint64_t stale = 0;
  const std::vector<ValveState> valves = api.board.Valves(false);
  for (const ValveState& valve : valves) {
    const bool silent = valve.silence != monitor::Silence::kNone;
    stale += silent ? 1 : 0;
    live += !silent && valve.quality == Quality::kLive ? 1 : 0;
  }
  return {{"now_ms", Ms(api.sources.utc_now_ns())},
          {"started_ms", Ms(api.sources.started_ns)},
          {"instance", api.instance},
          {"software", api.sources.software},
          {"health", facts.health},
          {"write", !api.token.empty()},
          {"stale_after_s", kStalePeriods * period_s},
          {"counters", std::move(counters)},
          {"valves",
           {{"known", valves.size()},
            {"live", live},
            {"stale", stale},
            {"open_episodes", facts.open_episodes}}},
          {"model_sets", std::move(sets)}};
}

Json Valves(const Api& api) {
  const auto alarms = api.alarms.ByValve();
  Json tiles = Json::array();
  for (const ValveState& valve : api.board.Valves()) {
    const auto found = alarms->find(valve.id);
    tiles.push_back(
        TileJson(valve, found == alarms->end() ? ValveAlarm{} : found->second));
  }
  return {{"now_ms", Ms(api.sources.utc_now_ns())},
          {"valves", std::move(tiles)}};
}

// Gaps of the valve and of the whole monitor, as the history has them.
void AddStoredGaps(const Api& api, const std::string& valve_id,
                   std::int64_t since_ns, Json& gaps) {
  storage::HistoryReader reader(api.sources.history);
  storage::EpisodeFilter filter;
  filter.since_ns = since_ns;
  for (const storage::DataGap& gap : reader.Gaps(filter)) {
    if (gap.valve_id.empty() ||
        (gap.valve_id == valve_id && gap.reason != "stream")) {
      gaps.push_back(
          GapJson({gap.valve_id, gap.from_ns, gap.to_ns, gap.reason}));
    }
  }
}

Json Trend(const Api& api, const httplib::Request& request) {
  const std::string valve_id = request.matches[1];
  const std::int64_t seconds =
      IntegerParameter(request, "seconds", 900, 1, 86'400);
  std::optional<LiveTrend> trend = api.board.Trend(valve_id);
  if (!trend) {
    throw NotFoundError("valve " + valve_id +
                        " has sent nothing since the monitor started");
  }
  const std::int64_t since_ns = trend->now.stamp_ns - seconds * kNsPerS;
  std::erase_if(trend->points, [since_ns](const monitor::TracePoint& point) {
    return point.sample.stamp_ns < since_ns;
  });
  Json json = TrendJson(trend->now.models.get(), valve_id, trend->points);
  json["gaps"] = Json::array();
  for (const monitor::DataGap& gap : trend->gaps) {
    json["gaps"].push_back(GapJson(gap));
  }
  AddStoredGaps(api, valve_id, since_ns, json["gaps"]);
  json["marks"] = MarksJson(trend->marks);
  json["words"] = trend->now.models && !trend->points.empty()
                      ? Json(Explain(*trend->now.models, trend->points.back(),
                                     [&api](std::string_view f) {
                                       return api.PlainName(f);
                                     }))
                      : Json();
  return json;
}

}  // namespace

void AddLiveRoutes(httplib::Server& server, const Api& api) {
  server.Get("/api/v1/status",
             Answering([&api](const httplib::Request&, httplib::Response&) {
               return Status(api);
             }));
  server.Get("/api/v1/faults",
             Answering([&api](const httplib::Request&, httplib::Response&) {
               return cli::FaultTextsJson(api.texts);
             }));
  server.Get("/api/v1/valves",
             Answering([&api](const httplib::Request&, httplib::Response&) {
               return Valves(api);
             }));
  server.Get(
      "/api/v1/valves/(.+)/trend",
      Answering([&api](const httplib::Request& request, httplib::Response&) {
        return Trend(api, request);
      }));
}

}  // namespace fdi::console
