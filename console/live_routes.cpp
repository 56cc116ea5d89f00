// Current state of the monitor and its valves, and the stream of changes.
#include <algorithm>
#include <limits>
#include <set>

#include <httplib.h>

#include "base/error.h"
#include "base/printable.h"
#include "base/time_units.h"
#include "console/api.h"
#include "diagnosis/model/verdict.h"
#include "report/findings/finding.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

namespace fdi::console {
namespace {

constexpr std::chrono::milliseconds kPingPeriod{5000};

Json Status(const Api& api, const httplib::Request& request) {
  const std::optional<Visitor> visitor = api.access.VisitorOf(request);
  const MonitorFacts facts = api.sources.facts();
  Json counters = Json::object();
  for (const auto& [name, value] : facts.counters) {
    counters[name] = value;
  }
  std::set<std::shared_ptr<const ModelFacts>> sets;
  double period_s = 1.0;
  std::uint64_t live = 0;
  std::uint64_t stale = 0;
  const std::vector<ValveState> valves = api.board.Valves(false);
  for (const ValveState& valve : valves) {
    const bool silent = valve.silence != monitor::Silence::kNone;
    stale += silent ? 1 : 0;
    live += !silent && valve.quality == Quality::kLive ? 1 : 0;
    if (valve.models) {
      sets.insert(valve.models);
      period_s = std::max(period_s, valve.models->period_s);
    }
  }
  std::uint64_t open = facts.open_episodes;
  if (api.sources.monitors) {
    open = static_cast<std::uint64_t>(std::ranges::count_if(
        *api.alarms.ByValve(),
        [](const auto& item) { return item.second.since_ns.has_value(); }));
  }
  Json model_sets = Json::array();
  for (const auto& models : sets) {
    model_sets.push_back(ModelFactsJson(*models));
  }
  return {{"now_ms", Ms(api.sources.utc_now_ns())},
          {"started_ms", Ms(api.sources.started_ns)},
          {"instance", api.instance},
          {"software", api.sources.software},
          {"health", facts.health},
          {"plant", PlantJson(api)},
          {"write", !api.sources.monitors && api.access.MayWrite(request)},
          {"user", visitor ? Json(visitor->name) : Json()},
          {"role", visitor ? Json(RoleName(visitor->role)) : Json()},
          {"stale_after_s", kGapPeriods * period_s},
          {"counters", std::move(counters)},
          {"valves",
           {{"known", valves.size()},
            {"live", live},
            {"stale", stale},
            {"open_episodes", open}}},
          {"model_sets", std::move(model_sets)}};
}

Json Valves(const Api& api, const httplib::Request& /*request*/) {
  const auto alarms = api.alarms.ByValve();
  Json tiles = Json::array();
  for (const ValveState& valve : api.board.Valves()) {
    tiles.push_back(TileJson(valve, AlarmFor(*alarms, valve.id)));
  }
  return {{"now_ms", Ms(api.sources.utc_now_ns())},
          {"valves", std::move(tiles)}};
}

// Gaps of the valve and of the whole monitor, from the history.
void AddStoredGaps(const Api& api, const std::string& valve_id,
                   std::int64_t since_ns, Json& gaps) {
  const auto reader = api.History();
  storage::EpisodeFilter filter;
  filter.since_ns = since_ns;
  for (const DataGap& gap : reader->Gaps(filter)) {
    if (gap.valve_id.empty() ||
        (gap.valve_id == valve_id && gap.reason != "stream")) {
      gaps.push_back(GapJson(gap));
    }
  }
}

Json WindowsJson(const ModelFacts& models,
                 const std::vector<TracePoint>& points) {
  Json json = Json::array();
  for (const WindowBeyond& window : WindowsBeyond(models, points)) {
    json.push_back({{"channel", models.channels[window.channel].name},
                    {"samples", window.length},
                    {"of", window.deviation ? "deviation" : "mean"},
                    {"value", window.value},
                    {"low", window.low},
                    {"high", window.high}});
  }
  return json;
}

// Facts on the valve from its entry and the table of the plant. The page of a
// plant does not have them.
Json About(const Api& api, const httplib::Request& request) {
  Json about = {{"type", nullptr},        {"service", nullptr},
                {"description", nullptr}, {"location", nullptr},
                {"document", nullptr},    {"grade", nullptr},
                {"group", nullptr},       {"repairs", Json::array()}};
  if (api.sources.plant_history || api.sources.models.empty()) {
    return about;
  }
  const std::string valve_id = request.matches[1];
  about["repairs"] = RepairsJson(api.Repairs(valve_id),
                                 std::numeric_limits<std::int64_t>::min());
  storage::ModelStore store(api.sources.models);
  if (const auto entry = store.FindValve(valve_id);
      entry && !entry->type.empty()) {
    about["type"] = entry->type;
  }
  if (const auto loop = storage::FindLoop(store, valve_id)) {
    if (const Json identity = findings::AboutJson(*loop);
        identity.is_object()) {
      about.update(identity);
    }
    about["group"] = loop->group.empty() ? Json() : Json(loop->group);
  }
  return about;
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
  Json windows = trend->now.models
                     ? WindowsJson(*trend->now.models, trend->points)
                     : Json::array();
  const std::int64_t since_ns = trend->now.stamp_ns - seconds * kNsPerSecond;
  std::erase_if(trend->points, [since_ns](const TracePoint& point) {
    return point.sample.stamp_ns < since_ns;
  });
  Json json = TrendJson(trend->now.models.get(), valve_id, trend->points);
  json["windows"] = std::move(windows);
  json["gaps"] = Json::array();
  for (const DataGap& gap : trend->gaps) {
    json["gaps"].push_back(GapJson(gap));
  }
  if (!api.sources.plant_history) {  // Polled every 2 s by a plant page.
    AddStoredGaps(api, valve_id, since_ns, json["gaps"]);
  }
  json["marks"] = Json::array();
  for (const Mark& mark : trend->marks) {
    json["marks"].push_back({{"t_ms", Ms(mark.stamp_ns)},
                             {"kind", TransitionName(mark.kind)},
                             {"text", mark.text}});
  }
  if (!trend->points.empty()) {
    AddRepairs(api.Repairs(valve_id), trend->points.front().sample.stamp_ns,
               trend->points.back().sample.stamp_ns, json["marks"]);
  }
  json["words"] =
      api.Words(trend->now.models.get(),
                trend->points.empty() ? nullptr : &trend->points.back());
  return json;
}

Json Faults(const Api& api, const httplib::Request& /*request*/) {
  return report::FaultTextsJson(api.texts);
}

void Stream(const Api& api, const httplib::Request& request,
            httplib::Response& response) {
  const std::string valve = Parameter(request, "valve").value_or("");
  if (valve.size() > kMaxIdLength) {
    SendError(response, 400, "valve: expected an id of 1..64 bytes");
    return;
  }
  // The samples begin here: a trend that the page requests after the hello
  // overlaps with them, so nothing is missed in between.
  const auto trend = api.board.Trend(valve, 0);
  const auto client = api.stream.Admit(
      valve, trend ? trend->next : 0,
      StreamEvent("hello", JsonText({{"now_ms", Ms(api.sources.utc_now_ns())},
                                     {"instance", api.instance}})));
  if (!client) {
    response.set_header("Retry-After", "5");
    SendError(response, 503, "all places for live streams are taken");
    return;
  }
  response.set_header("Cache-Control", "no-store");
  response.set_chunked_content_provider(
      "text/event-stream",
      [&stream = api.stream, client](std::size_t /*offset*/,
                                     httplib::DataSink& sink) {
        Message message;
        const auto outcome = stream.Next(*client, kPingPeriod, message);
        switch (outcome) {
          case LiveStream::Outcome::kMessage:
            return sink.write(message->data(), message->size());
          case LiveStream::Outcome::kTimeout:
            return sink.write(": ping\n\n", 8);
          case LiveStream::Outcome::kEnded:
            break;
        }
        return false;
      },
      [&stream = api.stream, client](bool /*success*/) {
        stream.Release(client);
      });
}

}  // namespace

std::vector<Route> LiveRoutes() {
  return {{"/api/v1/status", Status},
          {"/api/v1/faults", Faults},
          {"/api/v1/valves", Valves},
          {"/api/v1/valves/(.+)/about", About},
          {"/api/v1/valves/(.+)/trend", Trend}};
}

void AddStreamRoute(httplib::Server& server, const Api& api) {
  server.Get("/api/v1/stream", [&api](const httplib::Request& request,
                                      httplib::Response& response) {
    Stream(api, request, response);
  });
}

}  // namespace fdi::console
