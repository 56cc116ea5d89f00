#include "monitor/planner/read_work.h"

#include <algorithm>
#include <limits>
#include <map>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/health_rows.h"

namespace fdi::planner {
namespace {

using storage::Episode;

constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr double kMsPerHour = 3.6e6;
constexpr double kFullStroke = 100.0;  // [%]

// What an episode was: as its label says, or its answer.
std::string FaultOf(const Episode& episode) {
  const std::string label = episode.label.value_or("");
  return ParseFault(label) ? label : episode.fault.value_or("unknown");
}

// Labels on one answer in the plant.
struct Record {
  int right{0};
  int wrong{0};

  double trust() const { return (right + 1.0) / (right + wrong + 1.0); }
};

std::map<std::string, Record> RecordsOf(const std::vector<Episode>& episodes) {
  std::map<std::string, Record> records;
  for (const Episode& episode : episodes) {
    if (episode.label) {
      Record& record = records[episode.fault.value_or("unknown")];
      const bool right =
          *episode.label == "true" || *episode.label == episode.fault;
      ++(right ? record.right : record.wrong);
    }
  }
  return records;
}

// In order of detection: the last one stands.
void AddEpisode(const Episode& episode, const cli::FaultTexts& texts,
                std::vector<FaultReason>& reasons) {
  const std::string fault = FaultOf(episode);
  auto place = std::ranges::find(reasons, fault, &FaultReason::fault);
  if (place == reasons.end()) {
    place = reasons.insert(reasons.end(), FaultReason{});
    place->fault = fault;
  }
  place->words = texts.Words(fault, episode.strength);
  place->strength = episode.strength;
  place->factor = episode.peak_factor;
  ++place->episodes;
  place->confirmed = place->confirmed || episode.label.has_value();
  place->episode_id = episode.episode_id;
  place->detected_ns = episode.detected_ns;
  place->ended_ns = episode.ended_ns;
  place->last_ns = episode.trace_end_ns.value_or(episode.detected_ns);
}

std::vector<Episode> EpisodesOf(storage::HistoryReader& history,
                                const WorkQuery& query) {
  storage::EpisodeFilter filter;
  filter.valve_glob = query.valve_glob;
  filter.until_ns = query.since_ns;
  filter.state = storage::EpisodeState::kOpen;
  std::vector<Episode> episodes = history.List(filter);
  filter.since_ns = query.since_ns;
  filter.until_ns = std::numeric_limits<std::int64_t>::max();
  filter.state = storage::EpisodeState::kAny;
  for (Episode& episode : history.List(filter)) {
    episodes.push_back(std::move(episode));
  }
  return episodes;
}

void AddHealth(const std::vector<HealthHour>& hours, const WorkQuery& query,
               ValveWork& work) {
  if (hours.empty()) {
    return;
  }
  double live = 0.0;
  for (const HealthHour& hour : hours) {
    if (hour.epoch == hours.back().epoch) {
      work.travel_strokes +=
          static_cast<double>(hour.travel) * HealthHour::kTravel / kFullStroke;
      work.service_hours += static_cast<double>(hour.seen_ms) / kMsPerHour;
      live += static_cast<double>(hour.live_ms) / kMsPerHour;
    }
  }
  work.live_share = work.service_hours > 0.0 ? live / work.service_hours : 0.0;
  work.last_ns = hours.back().hour * kHourNs;
  for (const monitor::HealthLimit& limit : query.limits) {
    const monitor::HealthSeries series = SeriesOf(hours, limit);
    work.trends.push_back({limit, Forecast(series, limit), series.flow_unit});
  }
}

}  // namespace

std::vector<monitor::HealthLimit> DefaultLimits() {
  return {monitor::ParseHealthLimit("F=-10%"),
          monitor::ParseHealthLimit("F=10%")};
}

void RequireDiscipline(const std::string& discipline) {
  std::string accepted;
  for (const auto d : {cli::Discipline::kOperator, cli::Discipline::kInstrument,
                       cli::Discipline::kAir, cli::Discipline::kMechanical}) {
    if (discipline == DisciplineName(d)) {
      return;
    }
    accepted.append(" ").append(DisciplineName(d));
  }
  throw ConfigError("discipline '" + discipline + "' is none of" + accepted);
}

std::vector<WorkRow> ReadWorkList(storage::HistoryReader& history,
                                  const cli::FaultTexts& texts,
                                  const WorkQuery& query) {
  std::map<std::string, ValveWork> valves;
  const std::vector<Episode> episodes = EpisodesOf(history, query);
  for (const Episode& episode : episodes) {
    if (episode.label != "false") {
      AddEpisode(episode, texts, valves[episode.valve_id].faults);
    }
  }
  const std::map<std::string, Record> records = RecordsOf(episodes);
  for (const std::string& valve :
       HealthValves(history.database(), query.valve_glob)) {
    AddHealth(ReadHealth(history.database(), {valve, query.since_ns}), query,
              valves[valve]);
  }
  std::vector<ValveWork> work;
  for (auto& [valve, facts] : valves) {
    facts.valve_id = valve;
    for (FaultReason& reason : facts.faults) {
      const auto record = records.find(reason.fault);
      reason.trust = record == records.end() ? 1.0 : record->second.trust();
    }
    if (!query.discipline.empty()) {
      std::erase_if(facts.faults, [&query](const FaultReason& reason) {
        return reason.words.discipline.find(query.discipline) ==
               std::string::npos;
      });
      facts.trends.clear();
    }
    work.push_back(std::move(facts));
  }
  std::vector<WorkRow> rows = RankWork(std::move(work), query.options);
  if (query.top != 0 && rows.size() > query.top) {
    rows.resize(query.top);
  }
  return rows;
}

}  // namespace fdi::planner
