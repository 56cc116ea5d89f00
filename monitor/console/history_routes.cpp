// What the history tells: alarms, episodes, figures, shelves.
#include <algorithm>
#include <limits>

#include <httplib.h>

#include "monitor/console/api.h"
#include "storage/alarm_statistics.h"
#include "storage/cli/time_text.h"
#include "storage/history_shelf.h"

namespace fdi::console {
namespace {

using storage::Alarm;
using storage::HistoryReader;

constexpr std::int64_t kNsPerDay = 86'400'000'000'000;
constexpr std::int64_t kPageLimit = 1000;

Json AlarmsJson(const std::vector<Alarm>& alarms, const Api& api) {
  Json list = Json::array();
  for (const Alarm& alarm : alarms) {
    list.push_back(AlarmJson(alarm, api.texts));
  }
  return list;
}

Json Alarms(const Api& api) {
  const std::int64_t now_ns = api.sources.utc_now_ns();
  HistoryReader reader(api.sources.history);
  return {{"now_ms", Ms(now_ns)},
          {"alarms", AlarmsJson(CurrentAlarms(reader, now_ns), api)}};
}

storage::EpisodeFilter FilterOf(const Api& api,
                                const httplib::Request& request) {
  storage::EpisodeFilter filter;
  filter.valve_glob = Parameter(request, "valve").value_or("*");
  filter.fault = Parameter(request, "fault").value_or("");
  filter.since_ns = TimeParameter(request, "since_ms", filter.since_ns);
  filter.until_ns = TimeParameter(request, "until_ms", filter.until_ns);
  filter.state =
      storage::ParseEpisodeState(Parameter(request, "state").value_or("any"));
  filter.now_ns = api.sources.utc_now_ns();
  return filter;
}

// The newest first; a page ends before the oldest of the one before.
Json History(const Api& api, const httplib::Request& request) {
  storage::EpisodeFilter filter = FilterOf(api, request);
  const std::int64_t limit =
      IntegerParameter(request, "limit", 100, 1, kPageLimit);
  filter.until_ns = std::min(
      filter.until_ns, TimeParameter(request, "before_ms",
                                     std::numeric_limits<std::int64_t>::max()));
  filter.limit = limit + 1;
  HistoryReader reader(api.sources.history);
  std::vector<storage::Episode> episodes = reader.List(filter);
  std::reverse(episodes.begin(), episodes.end());
  const bool more = static_cast<std::int64_t>(episodes.size()) > limit;
  if (more) {
    episodes.pop_back();
  }
  const auto shelves = storage::ReadShelves(reader.database(), filter.now_ns);
  return {{"episodes", AlarmsJson(storage::AsAlarms(std::move(episodes),
                                                    shelves, filter.now_ns),
                                  api)},
          {"more", more}};
}

Json DaysJson(const storage::AlarmStatistics& statistics) {
  Json days = Json::array();
  for (const storage::DayAlarms& day : statistics.days) {
    days.push_back(
        {{"day", cli::FormatTime(day.day * kNsPerDay, true).substr(0, 10)},
         {"episodes", day.episodes},
         {"alarm_s", Rounded(day.alarm_s, 1)}});
  }
  return days;
}

Json ValvesJson(const storage::AlarmStatistics& statistics) {
  Json valves = Json::array();
  for (const auto& [id, valve] : statistics.valves) {
    valves.push_back({{"valve", id},
                      {"episodes", valve.episodes},
                      {"open", valve.open},
                      {"alarm_s", Rounded(valve.alarm_s, 1)},
                      {"chattering", valve.chattering},
                      {"standing", valve.standing},
                      {"last_ms", Ms(valve.last_detected_ns)}});
  }
  return valves;
}

Json FaultsJson(const storage::AlarmStatistics& statistics, const Api& api) {
  Json faults = Json::array();
  for (const auto& [fault, figures] : statistics.faults) {
    faults.push_back({{"fault", TextOrNull(fault)},
                      {"name", api.texts.Words(fault, 0.0).name},
                      {"episodes", figures.episodes},
                      {"right", figures.right},
                      {"wrong", figures.wrong}});
  }
  return faults;
}

Json Statistics(const Api& api, const httplib::Request& request) {
  const storage::EpisodeFilter filter = FilterOf(api, request);
  HistoryReader reader(api.sources.history);
  const auto statistics = storage::ComputeAlarmStatistics(
      storage::ReadAlarmSpans(reader.database(), filter), filter.since_ns,
      filter.until_ns, filter.now_ns);
  Json gaps = Json::array();
  for (const storage::DataGap& gap : reader.Gaps(filter)) {
    gaps.push_back(GapJson({gap.valve_id, gap.from_ns, gap.to_ns, gap.reason}));
  }
  return {{"per_day", DaysJson(statistics)},
          {"valves", ValvesJson(statistics)},
          {"faults", FaultsJson(statistics, api)},
          {"labelled",
           {{"true", statistics.labelled_true},
            {"false", statistics.labelled_false},
            {"none", statistics.unlabelled}}},
          {"most_in_10_min", statistics.most_in_flood_window},
          {"gaps", std::move(gaps)}};
}

Json Shelves(const Api& api) {
  HistoryReader reader(api.sources.history);
  Json list = Json::array();
  for (const storage::Shelf& shelf :
       storage::ReadShelves(reader.database(), api.sources.utc_now_ns())) {
    list.push_back(ShelfJson(shelf));
  }
  return {{"shelf", std::move(list)}};
}

}  // namespace

void AddHistoryRoutes(httplib::Server& server, const Api& api) {
  server.Get("/api/v1/alarms",
             Answering([&api](const httplib::Request&, httplib::Response&) {
               return Alarms(api);
             }));
  server.Get(
      "/api/v1/history",
      Answering([&api](const httplib::Request& request, httplib::Response&) {
        return History(api, request);
      }));
  server.Get(
      "/api/v1/statistics",
      Answering([&api](const httplib::Request& request, httplib::Response&) {
        return Statistics(api, request);
      }));
  server.Get("/api/v1/shelf",
             Answering([&api](const httplib::Request&, httplib::Response&) {
               return Shelves(api);
             }));
}

}  // namespace fdi::console
