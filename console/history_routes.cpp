// Routes that read the history: alarms, episodes with their evidence,
// statistics, shelves.
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <limits>
#include <sstream>

#include <httplib.h>

#include "base/error.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "console/api.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/csv.h"
#include "report/plot/episode_figure.h"
#include "report/plot/episode_text.h"
#include "report/plot/gnuplot.h"
#include "report/report.h"
#include "storage/history/common_cause.h"
#include "storage/history/foreign_history.h"
#include "storage/history/history_reader.h"
#include "storage/history/strength.h"
#include "storage/models/models.h"

namespace fdi::console {
namespace {

constexpr std::int64_t kPageLimit = 1000;

Json Alarms(const Api& api, const httplib::Request& /*request*/) {
  const std::int64_t now_ns = api.sources.utc_now_ns();
  std::vector<storage::Alarm> alarms = api.alarms.UnstoredAlarms();
  const bool plant = api.sources.plant_history != nullptr;
  if (!plant) {
    std::ranges::move(api.History()->AlarmList(now_ns, kMaxAlarms),
                      std::back_inserter(alarms));
  }
  Json rows = AlarmsJson(alarms, api.texts, *api.alarms.Facts());
  // A database that is locked or out of reach holds up nobody who asks.
  AlarmBook::Rows last = plant ? api.alarms.Stored() : AlarmBook::Rows{};
  std::ranges::move(last.rows, std::back_inserter(rows));
  return {{"now_ms", Ms(now_ns)},
          {"alarms", std::move(rows)},
          {"note", TextOrNull(last.note)}};
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

// Newest first. The next page continues below the oldest row of the previous
// one, given as before_ms. Valves that one cause disturbs are often detected at
// the same instant, so a page has all episodes of its last millisecond, even if
// they are more than `limit`.
Json History(const Api& api, const httplib::Request& request) {
  storage::EpisodeFilter filter = FilterOf(api, request);
  const std::int64_t limit =
      IntegerParameter(request, "limit", 100, 1, kPageLimit);
  filter.until_ns = std::min(
      filter.until_ns, TimeParameter(request, "before_ms",
                                     std::numeric_limits<std::int64_t>::max()));
  filter.limit = limit;
  const auto reader = api.History();
  std::vector<storage::Episode> episodes = reader->List(filter);
  const std::string note = storage::TakeNote(*reader);
  bool more = false;
  if (std::ssize(episodes) == limit) {
    storage::EpisodeFilter older = filter;
    older.until_ns = episodes.front().detected_ns / kNsPerMs * kNsPerMs;
    older.limit = 1;
    more = !reader->List(older).empty();
    filter.since_ns = std::max(filter.since_ns, older.until_ns);
    filter.limit = 0;
    episodes = reader->List(filter);
  }
  std::reverse(episodes.begin(), episodes.end());
  return {{"episodes",
           AlarmsJson(reader->Alarms(std::move(episodes), filter.now_ns),
                      api.texts, *api.alarms.Facts())},
          {"more", more},
          {"note", TextOrNull(note)}};
}

Json DaysJson(const storage::AlarmStatistics& statistics) {
  Json days = Json::array();
  for (const storage::DayAlarms& day : statistics.days) {
    days.push_back(
        {{"day", FormatTime(day.day * kNsPerDay, true).substr(0, 10)},
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
                      {"name", fault.empty() || fault == "unknown"
                                   ? "Without a name"
                                   : api.texts.Words(fault, 0.0).name},
                      {"episodes", figures.episodes},
                      {"right", figures.right},
                      {"wrong", figures.wrong}});
  }
  return faults;
}

Json Statistics(const Api& api, const httplib::Request& request) {
  const storage::EpisodeFilter filter = FilterOf(api, request);
  const auto reader = api.History();
  const auto statistics = reader->AlarmFigures(filter, filter.now_ns);
  Json gaps = Json::array();
  for (const DataGap& gap : reader->Gaps(filter)) {
    gaps.push_back(GapJson(gap));
  }
  return {{"per_day", DaysJson(statistics)},
          {"valves", ValvesJson(statistics)},
          {"faults", FaultsJson(statistics, api)},
          {"labelled",
           {{"true", statistics.labelled_true},
            {"false", statistics.labelled_false},
            {"none", statistics.unlabelled}}},
          {"most_in_10_min", statistics.most_in_flood_window},
          {"gaps", std::move(gaps)},
          {"note", TextOrNull(storage::TakeNote(*reader))}};
}

Json Shelves(const Api& api, const httplib::Request& /*request*/) {
  const auto reader = api.History();
  Json list = Json::array();
  for (const storage::Shelf& shelf :
       reader->Shelves(api.sources.utc_now_ns())) {
    list.push_back(ShelfJson(shelf));
  }
  return {{"shelf", std::move(list)},
          {"note", TextOrNull(storage::TakeNote(*reader))}};
}

// The open common causes.
Json Causes(const Api& api, const httplib::Request& /*request*/) {
  Json list = Json::array();
  const auto history = api.History();
  for (const storage::CommonCause& cause : history->OpenCauses()) {
    Json members = Json::array();
    for (const storage::CauseMember& member : cause.members) {
      members.push_back({{"episode", member.episode_id},
                         {"valve", member.valve_id},
                         {"fault", TextOrNull(member.fault)}});
    }
    list.push_back({{"group", cause.group},
                    {"opened_ms", Ms(cause.opened_ns)},
                    {"members", std::move(members)}});
  }
  return {{"causes", std::move(list)},
          {"note", TextOrNull(storage::TakeNote(*history))}};
}

// Operator actions have a value and who; transitions have what was decided.
Json EventJson(const storage::HistoryEntry& event) {
  const bool by_hand = !event.who.empty();
  return {{"kind", event.kind},
          {"at_ms", Ms(event.stamp_ns)},
          {"recorded_ms", Ms(event.recorded_ns)},
          {"faults", TextOrNull(event.faults)},
          {"factor", by_hand ? Json() : Rounded(event.factor, 3)},
          {"strength", by_hand ? Json() : Rounded(event.strength, 3)},
          {"reason", TextOrNull(event.reason)},
          {"layer", TextOrNull(event.layer)},
          {"value", TextOrNull(event.value)},
          {"who", TextOrNull(event.who)},
          {"comment", TextOrNull(event.comment)},
          {"origin", TextOrNull(event.origin)}};
}

Json MarksOf(const std::vector<storage::HistoryEntry>& events) {
  Json marks = Json::array();
  for (const storage::HistoryEntry& event : events) {
    if (event.who.empty()) {
      marks.push_back({{"t_ms", Ms(event.stamp_ns)},
                       {"kind", event.kind},
                       {"text", !event.value.empty()   ? event.value
                                : event.faults.empty() ? event.reason
                                                       : event.faults}});
    }
  }
  return marks;
}

Json GapsOf(storage::History& history, const storage::Episode& episode,
            const std::vector<TracePoint>& points) {
  Json gaps = Json::array();
  if (points.empty()) {
    return gaps;
  }
  storage::EpisodeFilter filter;
  filter.since_ns = points.front().sample.stamp_ns;
  filter.until_ns = points.back().sample.stamp_ns;
  for (const DataGap& gap : history.Gaps(filter)) {
    if (gap.valve_id.empty() || gap.valve_id == episode.valve_id) {
      gaps.push_back(GapJson(gap));
    }
  }
  return gaps;
}

// The most informative instant of the episode: at its isolation, else the last
// abnormal one.
const TracePoint* MostInformativePoint(const storage::Episode& episode,
                                       const std::vector<TracePoint>& points) {
  const TracePoint* telling = nullptr;
  for (const TracePoint& point : points) {
    const bool before_isolation =
        !episode.isolated_ns || point.sample.stamp_ns <= *episode.isolated_ns;
    if (point.state != State::kNormal && before_isolation) {
      telling = &point;
    }
  }
  return telling;
}

// Result of a second look; its simulation becomes columns of the trace.
Json LookJson(const std::optional<EpisodeLook>& look,
              const std::vector<TracePoint>& points, Json& trace) {
  if (!look) {
    return {};
  }
  Json faults = Json::array();
  for (const LookFault& f : look->faults) {
    faults.push_back({{"fault", FaultName(f.fault)},
                      {"strength", Rounded(f.strength, 3)},
                      {"lowest", Rounded(f.lowest, 3)},
                      {"highest", Rounded(f.highest, 3)},
                      {"begins_ms", Ms(f.begins_ns)},
                      {"growing", f.growing}});
  }
  Json& x = trace["x_sim"] = Json::array();
  Json& flow = trace["f_sim"] = Json::array();
  for (const TracePoint& point : points) {
    const auto row = look->RowAt(point.sample.stamp_ns);
    x.push_back(row ? Rounded(look->x_pct[*row], 3) : Json());
    flow.push_back(row && point.sample.Has(Signal::kF)
                       ? Rounded(look->flow[*row], 4)
                       : Json());
  }
  return {{"misfit", Rounded(look->misfit, 2)}, {"faults", std::move(faults)}};
}

// Growth of each fault of the name.
Json GrowthJson(const std::vector<Growth>& growths) {
  Json list = Json::array();
  for (const Growth& growth : growths) {
    const StrengthPoint& last = growth.last;
    Json json = {{"fault", FaultName(last.fault)},
                 {"at_ms", Ms(last.stamp_ns)},
                 {"strength", Rounded(last.strength, 3)},
                 {"lowest", Rounded(last.lowest, 3)},
                 {"highest", Rounded(last.highest, 3)},
                 {"rate", Json()},
                 {"full_in_ms", Json()}};
    const auto interval = [](double value, double lowest, double highest) {
      return Json{{"value", Rounded(value, 4)},
                  {"lowest", Rounded(lowest, 4)},
                  {"highest", Rounded(highest, 4)}};
    };
    if (const auto& rate = growth.rate) {
      json["rate"] = interval(rate->per_day, rate->lowest, rate->highest);
    }
    if (const auto& full = growth.full) {
      json["full_in_ms"] = interval(1e3 * full->seconds, 1e3 * full->lowest,
                                    1e3 * full->highest);
    }
    list.push_back(std::move(json));
  }
  return list;
}

Json Episode(const Api& api, const httplib::Request& request) {
  const auto reader = api.History();
  const storage::Alarm alarm =
      reader
          ->Alarms({reader->Show(std::string(request.matches[1]))},
                   api.sources.utc_now_ns())
          .front();
  const storage::Episode& episode = alarm.episode;
  const auto events = reader->Events(episode.id);
  const std::vector<TracePoint> points = reader->Trace(episode.id);
  const auto models = api.models.For(episode);

  Json trace = TrendJson(models.get(), episode.valve_id, points);
  trace["gaps"] = GapsOf(*reader, episode, points);
  trace["marks"] = MarksOf(events);
  const auto repairs = api.Repairs(episode.valve_id);
  if (!points.empty()) {
    AddRepairs(repairs, points.front().sample.stamp_ns,
               points.back().sample.stamp_ns, trace["marks"]);
  }
  trace["words"] =
      api.Words(models.get(), MostInformativePoint(episode, points));
  Json list = Json::array();
  for (const storage::HistoryEntry& event : events) {
    list.push_back(EventJson(event));
  }
  Json look = LookJson(reader->Look(episode.id), points, trace);
  Json growth =
      GrowthJson(storage::GrowthOf(episode, reader->Strengths(episode.id)));
  return {{"episode", AlarmJson(alarm, api.texts, *api.alarms.Facts())},
          {"events", std::move(list)},
          {"repairs", RepairsJson(repairs, episode.detected_ns)},
          {"look", std::move(look)},
          {"growth", std::move(growth)},
          {"note", TextOrNull(storage::TakeNote(*reader))},
          {"trace", std::move(trace)},
          {"model_hash", ModelFactsJson(*models)["hash"]}};
}

std::string ColumnName(Signal signal, FlowUnit unit, bool has_pv) {
  for (const importer::SignalColumn& column : importer::kSignalColumns) {
    if (column.signal == signal &&
        (signal != Signal::kF || column.flow_unit == unit) &&
        (signal != Signal::kSp || NeedsPv(column) == has_pv)) {
      return std::string(column.name);
    }
  }
  return std::string(SignalName(signal));
}

Json CsvRow(const TracePoint& point, SignalMask signals,
            const ModelFacts& models) {
  Json row{{"utc", FormatTime(point.sample.stamp_ns, true)}};
  const auto value = [](const std::vector<double>& values, std::size_t i) {
    return i < values.size() ? Rounded(values[i], 6) : Json();
  };
  const bool has_pv = (signals & MaskOf(Signal::kPv)) != 0;
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if ((signals & MaskOf(signal)) != 0) {
      row[ColumnName(signal, models.flow_unit, has_pv)] =
          ReadingJson(point.sample, signal, 6);
    }
  }
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    row["r_" + models.channels[c].name] = value(point.residuals, c);
  }
  row["d0"] = Rounded(point.normal_factor, 6);
  for (std::size_t f = 0; f < models.faults.size(); ++f) {
    row["d_" + models.faults[f]] = value(point.factors, f);
  }
  row["state"] = StateName(point.state);
  row["quality"] = QualityName(point.quality);
  return row;
}

// The evidence as CSV: readings in the columns that the programs import, then
// residuals r_CHANNEL, d0 and d_FAULT.
File EpisodeCsv(const Api& api, const httplib::Request& request) {
  const std::string id = request.matches[1];
  const auto reader = api.History();
  const storage::Episode episode = reader->Show(id);
  const auto models = api.models.For(episode);
  const std::vector<TracePoint> points = reader->Trace(episode.id);
  SignalMask signals = 0;
  for (const TracePoint& point : points) {
    signals = static_cast<SignalMask>(signals | point.sample.present);
  }
  std::vector<report::Column> columns;
  const Json keys = CsvRow({}, signals, *models);
  for (const auto& [key, value] : keys.items()) {
    columns.push_back({key, key});
  }
  report::Report report;
  Json& rows = report.document["rows"] = Json::array();
  for (const TracePoint& point : points) {
    rows.push_back(CsvRow(point, signals, *models));
  }
  std::ostringstream csv;
  report.Table("rows", std::move(columns)).PrintCsv(csv);
  return {"text/csv; charset=utf-8", "episode-" + id + ".csv", csv.str()};
}

// The picture of `fdi-store history plot`, drawn by gnuplot.
File EpisodePicture(const Api& api, const httplib::Request& request) {
  const std::string id = request.matches[1];
  const std::string ending = request.matches[2];
  if (!plot::HaveGnuplot()) {
    throw NotFoundError(
        "gnuplot is not installed; on Debian it is in gnuplot-nox");
  }
  const auto reader = api.History();
  const plot::EpisodeEvidence evidence =
      plot::LoadEvidence(*reader, id, api.sources.models);
  plot::EpisodeFigureOptions options;
  options.fault_name = plot::PlainName(evidence.episode, api.texts);
  const bool svg = ending == "svg";
  return {svg ? "image/svg+xml" : "image/png", "episode-" + id + "." + ending,
          plot::DrawFigure(plot::EpisodeFigure(evidence, options),
                           svg ? plot::Format::kSvg : plot::Format::kPng,
                           {.stop = api.stopping})};
}

}  // namespace

std::vector<Route> HistoryRoutes() {
  return {{"/api/v1/alarms", Alarms},
          {"/api/v1/history", History},
          {"/api/v1/statistics", Statistics},
          {"/api/v1/shelf", Shelves},
          {"/api/v1/causes", Causes},
          {"/api/v1/episodes/([0-9a-fA-F]{1,16}|last)", Episode},
          {"/api/v1/episodes/([0-9a-f]{1,16}|last)\\.csv", nullptr, EpisodeCsv},
          {"/api/v1/episodes/([0-9a-f]{1,16}|last)\\.(svg|png)", nullptr,
           EpisodePicture}};
}

}  // namespace fdi::console
