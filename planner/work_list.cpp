#include "planner/work_list.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "storage/history/certainty.h"
#include "storage/history/health.h"

namespace fdi::planner {
namespace {

using report::Json;
using storage::Episode;

constexpr double kOtherReasons = 0.25;
constexpr double kRepetition = 0.1;
constexpr double kMaxRepetition = 2.0;

template <typename Reason>
void SortByWeight(std::vector<Reason>& reasons, const WorkOptions& options) {
  std::ranges::stable_sort(reasons, [&](const Reason& a, const Reason& b) {
    return WeightOf(a, options) > WeightOf(b, options);
  });
}

// "less than a minute", "40 min", "5 h", "3 days"
std::string SpanText(std::int64_t span_ns) {
  const double hours = std::max(0.0, static_cast<double>(span_ns)) / kNsPerHour;
  const std::int64_t minutes = std::lround(hours * 60.0);
  if (minutes == 0) {
    return "less than a minute";
  }
  if (hours < 1.0) {
    return std::to_string(minutes) + " min";
  }
  if (hours < 2.0 * 24.0) {
    return std::to_string(std::lround(hours)) + " h";
  }
  return std::to_string(std::lround(hours / 24.0)) + " days";
}

std::string FaultText(const FaultReason& reason, const WorkOptions& options) {
  std::string text = reason.words.name + ": ";
  // A monitor's clock may be ahead of this one. Spans up to an earlier time
  // than the newest evidence would be too short.
  const std::int64_t now_ns = std::max(options.now_ns, reason.last_ns);
  text += reason.ended_ns
              ? "ended " + SpanText(now_ns - *reason.ended_ns) + " ago"
              : "stands for " + SpanText(now_ns - reason.detected_ns);
  if (reason.unconfirmed_ns) {
    text += ", not confirmed for " + SpanText(now_ns - *reason.unconfirmed_ns);
  }
  text += ", severity " + std::string(SeverityName(reason.words.severity));
  if (const double percent = std::round(100.0 * reason.strength);
      percent != 0.0) {
    text += ", strength " + report::FormatNumber(percent, 0) + " %";
  }
  if (reason.episodes > 1) {
    text += ", " + std::to_string(reason.episodes) + " episodes";
  }
  if (reason.confirmed) {
    text += ", confirmed by a label";
  } else if (reason.trust < 0.5) {
    text += ", labels called this answer wrong before";
  }
  return text;
}

std::string TrendText(const LimitTrend& trend) {
  const HealthLimit& limit = trend.limit;
  const std::string unit = HealthUnit(limit, trend.flow_unit);
  const std::string name = limit.kind == HealthLimit::Kind::kStrength
                               ? FaultName(limit.fault) + " strength"
                           : limit.kind == HealthLimit::Kind::kTravel ? "travel"
                           : limit.kind == HealthLimit::Kind::kReversals
                               ? "reversals"
                               : std::string(SignalName(limit.signal));
  std::string text = name;
  if (trend.forecast.now) {
    text += " at " + report::FormatNumber(*trend.forecast.now, 2) +
            (unit.empty() ? "" : " " + unit);
  }
  return text + ", limit " + HealthLimitText(limit) + ": " +
         ForecastText(trend.forecast);
}

// "Dead band of the valve: 1.40 % of travel over the last day, accepted up to
// 1.00"
std::string FigureText(const FigureReason& reason) {
  const report::FigureText& text = reason.text;
  const bool low = text.lowest && reason.value < *text.lowest;
  return text.name + ": " + report::FormatNumber(reason.value, 2) +
         (text.unit.empty() ? "" : " " + text.unit) +
         " over the last day, accepted " +
         (low ? "from " + report::FormatNumber(*text.lowest, 2)
              : "up to " + report::FormatNumber(*text.highest, 2));
}

// A reason of any kind, with its weight.
struct WeightedText {
  double weight;
  std::string text;
};

std::vector<WeightedText> TextsOf(const ValveWork& work,
                                  const WorkOptions& options) {
  std::vector<WeightedText> texts;
  for (const FaultReason& reason : work.faults) {
    texts.push_back({WeightOf(reason, options), FaultText(reason, options)});
  }
  for (const LimitTrend& trend : work.trends) {
    texts.push_back({WeightOf(trend, options), TrendText(trend)});
  }
  for (const ChannelDrift& drift : work.drifts) {
    texts.push_back({WeightOf(drift, options), DriftText(drift)});
  }
  for (const FigureReason& figure : work.figures) {
    texts.push_back({WeightOf(figure, options), FigureText(figure)});
  }
  return texts;
}

double ScoreOf(const ValveWork& work, const WorkOptions& options) {
  double most = 0.0;
  double sum = 0.0;
  for (const auto& [weight, text] : TextsOf(work, options)) {
    most = std::max(most, weight);
    sum += weight;
  }
  return most + kOtherReasons * (sum - most);
}

constexpr const char* kUnknown = "unknown";

// The fault of an episode according to its label, or else its diagnosis.
std::string FaultOf(const Episode& episode) {
  const std::string label = episode.label.value_or("");
  return ParseFault(label) ? label : episode.fault.value_or(kUnknown);
}

// How often labels in the plant confirmed or contradicted one diagnosis.
struct Record {
  int right{0};
  int wrong{0};

  // As if one label had confirmed the diagnosis before: without labels it is
  // trusted fully, and a single wrong one halves the trust.
  double trust() const { return (right + 1.0) / (right + wrong + 1.0); }
};

std::map<std::string, Record> RecordsOf(const std::vector<Episode>& episodes) {
  std::map<std::string, Record> records;
  for (const Episode& episode : episodes) {
    if (episode.label) {
      // Counted by what was diagnosed, not by what the label says: the record
      // is one of the diagnosis.
      Record& record = records[episode.fault.value_or(kUnknown)];
      const bool right =
          *episode.label == "true" || *episode.label == episode.fault;
      ++(right ? record.right : record.wrong);
    }
  }
  return records;
}

// Episodes come in order of detection, so the newest one decides.
void AddEpisode(const Episode& episode, const report::FaultTexts& texts,
                std::vector<FaultReason>& reasons) {
  const std::string fault = FaultOf(episode);
  auto place = std::ranges::find(reasons, fault, &FaultReason::fault);
  if (place == reasons.end()) {
    place = reasons.insert(reasons.end(), FaultReason{});
    place->fault = fault;
  }
  // A label that names another fault has no stored priority.
  place->words =
      texts.Words(fault, episode.strength,
                  fault == episode.fault ? episode.priority : std::nullopt);
  const std::string_view no_name = storage::NoNameText(episode);
  place->named = fault != kUnknown || no_name.empty();
  if (!place->named) {
    place->words.name = no_name;
  }
  place->strength = episode.strength;
  place->factor = episode.peak_factor;
  ++place->episodes;
  // Episodes labelled false have been left out, so any label confirms.
  place->confirmed = place->confirmed || episode.label.has_value();
  place->episode_id = episode.episode_id;
  place->detected_ns = episode.detected_ns;
  // The end of the data is no return to normal.
  place->unconfirmed_ns = episode.unconfirmed_ns;
  place->ended_ns = episode.unconfirmed_ns ? std::nullopt : episode.ended_ns;
  place->last_ns = episode.trace_end_ns.value_or(episode.detected_ns);
}

std::vector<Episode> EpisodesOf(storage::History& history,
                                const WorkQuery& query) {
  // Open episodes count however old they are. Those detected before the period
  // come first, so that the whole list is in order of detection, on which
  // AddEpisode() relies.
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
  // The plant history has an episode that moved with its valve twice.
  std::set<std::string> seen;
  std::erase_if(episodes, [&seen](const Episode& episode) {
    return !seen.insert(episode.episode_id).second;
  });
  return episodes;
}

// Of how many events a figure is the mean; a share of the time needs none.
std::int64_t EventsOf(loop::Figure figure, const loop::ValveCounts& counts) {
  switch (figure) {
    case loop::Figure::kAtLimit:
      return std::numeric_limits<std::int64_t>::max();
    case loop::Figure::kSlipJump:
      return counts.slips;
    case loop::Figure::kDeadBand:
      return counts.turns;
    case loop::Figure::kErrorBand:
      return std::min(counts.opening, counts.closing);
    case loop::Figure::kDelay:
    case loop::Figure::kT63:
    case loop::Figure::kT86:
    case loop::Figure::kOvershoot:
    case loop::Figure::kTravelGain:
      break;
  }
  return counts.steps;
}

// The figures beyond their limits in the last day with this equipment. One
// event may be chance.
std::vector<FigureReason> FiguresOf(const std::vector<HealthHour>& hours,
                                    const report::FaultTexts& texts) {
  constexpr std::int64_t kDayHours = 24;
  constexpr std::int64_t kFewest = 5;
  loop::ValveCounts counts;
  std::int64_t seen_ms = 0;
  for (const HealthHour& hour : hours) {
    if (hour.epoch == hours.back().epoch &&
        hour.hour > hours.back().hour - kDayHours) {
      counts.Add(hour.counts);
      seen_ms += hour.seen_ms;
    }
  }
  std::vector<FigureReason> reasons;
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const auto figure = static_cast<loop::Figure>(i);
    const auto value = loop::FigureOf(figure, counts, seen_ms);
    if (value && EventsOf(figure, counts) >= kFewest &&
        texts.Of(figure).Exceeded(*value)) {
      reasons.push_back(
          {texts.Of(figure), *value, hours.back().hour * kNsPerHour});
    }
  }
  return reasons;
}

void AddHealth(const std::vector<HealthHour>& hours,
               const report::FaultTexts& texts, const WorkQuery& query,
               ValveWork& work) {
  if (hours.empty()) {
    return;
  }
  double live = 0.0;
  // Travel and hours since the last work on the valve: earlier epochs belong to
  // parts that are gone.
  for (const HealthHour& hour : hours) {
    if (hour.epoch == hours.back().epoch) {
      work.travel_strokes += static_cast<double>(hour.travel) *
                             HealthHour::kTravel / HealthHour::kFullStroke;
      work.service_hours += static_cast<double>(hour.seen_ms) / kMsPerHour;
      live += static_cast<double>(hour.live_ms) / kMsPerHour;
    }
  }
  work.live_share = work.service_hours > 0.0 ? live / work.service_hours : 0.0;
  work.last_ns = hours.back().hour * kNsPerHour;
  work.host = hours.back().host;
  work.monitor = hours.back().monitor;
  work.trends = TrendsOf(hours, query.limits);
  work.drifts = DriftsOf(hours);
  work.figures = FiguresOf(hours, texts);
}

void RequireDiscipline(const std::string& discipline) {
  std::string accepted;
  for (const auto d :
       {report::Discipline::kOperator, report::Discipline::kInstrument,
        report::Discipline::kAir, report::Discipline::kMechanical}) {
    if (discipline == DisciplineName(d)) {
      return;
    }
    accepted.append(" ").append(DisciplineName(d));
  }
  throw ConfigError("discipline '" + discipline + "' is none of" + accepted);
}

Json RowJson(const WorkRow& row) {
  const ValveWork& work = row.work;
  Json json{{"rank", row.rank},
            {"valve_id", work.valve_id},
            {"score", SixDigits(row.score)},
            {"why", row.why}};
  if (!work.monitor.empty()) {
    json.update({{"host", work.host}, {"monitor", work.monitor}});
  }
  for (const char* key :
       {"fault", "name", "discipline", "namur", "severity", "check", "strength",
        "open", "episodes", "episode_id", "detected_utc", "confirmed"}) {
    json[key] = nullptr;
  }
  if (!work.faults.empty()) {
    const FaultReason& fault = work.faults.front();
    json.update(
        {{"fault", fault.named ? Json(fault.fault) : Json()},
         {"name", fault.words.name},
         {"discipline", fault.words.discipline},
         {"namur", NamurName(fault.words.namur)},
         {"severity", SeverityName(fault.words.severity)},
         {"check", fault.words.check},
         {"strength", fault.named ? Json(SixDigits(fault.strength)) : Json()},
         {"open", !fault.ended_ns},
         {"episodes", fault.episodes},
         {"episode_id", fault.episode_id},
         {"detected_utc", FormatTime(fault.detected_ns, true)},
         {"confirmed", fault.confirmed}});
  } else if (!work.figures.empty()) {
    const report::FigureText& text = work.figures.front().text;
    json.update({{"name", text.name},
                 {"discipline", DisciplineName(text.discipline)},
                 {"namur", NamurName(text.namur)},
                 {"check", text.check}});
  }
  json["trends"] = TrendsJson(work.trends);
  json["travel_strokes"] = SixDigits(work.travel_strokes);
  json["service_hours"] = SixDigits(work.service_hours);
  json["live_share"] = SixDigits(work.live_share);
  json["last_utc"] =
      work.last_ns ? Json(FormatTime(*work.last_ns, true)) : Json();
  return json;
}

std::string RowText(const WorkRow& row) {
  const ValveWork& work = row.work;
  const std::string where =
      work.monitor.empty() ? "" : " of " + work.host + "/" + work.monitor;
  std::string text = std::to_string(row.rank) + ". " + work.valve_id + where +
                     "  (" + report::FormatNumber(row.score, 2) +
                     ")\n   because " + row.why;
  if (!work.faults.empty()) {
    const report::FaultWords& words = work.faults.front().words;
    text += "\n   " + words.discipline + ": " + words.check;
  } else if (!work.figures.empty()) {
    const report::FigureText& figure = work.figures.front().text;
    text.append("\n   ").append(DisciplineName(figure.discipline));
    text += ": " + figure.check;
  }
  if (work.service_hours > 0.0) {
    text += "\n   " + report::FormatNumber(work.travel_strokes, 0) +
            " strokes in " +
            report::FormatNumber(work.service_hours,
                                 work.service_hours < 10.0 ? 1 : 0) +
            " h, " + report::FormatNumber(100.0 * work.live_share, 0) +
            " % of it judged";
  }
  return text;
}

// U = 2^(−days/half life) since `end_ns`; an end ahead of now_ns counts as now.
double Fading(std::int64_t end_ns, const WorkOptions& options) {
  const double days =
      std::max(0.0, static_cast<double>(options.now_ns - end_ns) / kNsPerDay);
  return std::exp2(-days / options.half_life_days);
}

}  // namespace

double SeverityPoints(Severity severity) {
  return std::ldexp(1.0, static_cast<int>(severity));
}

double ConfidenceOf(const FaultReason& reason) {
  return reason.confirmed ? 1.0
                          : std::clamp(reason.factor, 0.0, 1.0) * reason.trust;
}

double WeightOf(const FaultReason& reason, const WorkOptions& options) {
  //     R = min(2, 1 + 0.1 (n − 1))
  const double repetition = std::min(
      kMaxRepetition, 1.0 + kRepetition * std::max(0, reason.episodes - 1));
  return SeverityPoints(reason.words.severity) * ConfidenceOf(reason) *
         (reason.ended_ns ? Fading(*reason.ended_ns, options) : 1.0) *
         repetition;
}

double WeightOf(const ChannelDrift& drift, const WorkOptions& options) {
  return SeverityPoints(Severity::kLow) * Fading(drift.last_ns, options);
}

double WeightOf(const FigureReason& figure, const WorkOptions& options) {
  return SeverityPoints(Severity::kLow) * Fading(figure.last_ns, options);
}

double WeightOf(const LimitTrend& reason, const WorkOptions& options) {
  using Answer = HealthForecast::Answer;
  const double points = SeverityPoints(Severity::kHigh);
  if (reason.forecast.answer == Answer::kReached) {
    return points;
  }
  if (reason.forecast.answer != Answer::kTime) {
    return 0.0;
  }
  return points *
         std::max(0.0, 1.0 - reason.forecast.time->days / options.horizon_days);
}

std::vector<WorkRow> RankWork(std::vector<ValveWork> valves,
                              const WorkOptions& options) {
  std::vector<WorkRow> rows;
  for (ValveWork& work : valves) {
    const double score = ScoreOf(work, options);
    if (score <= 0.0) {
      continue;
    }
    // The first fault of a row is shown with its check, so the weightiest comes
    // first.
    SortByWeight(work.faults, options);
    SortByWeight(work.trends, options);
    std::erase_if(work.trends, [&](const LimitTrend& reason) {
      return WeightOf(reason, options) <= 0.0;
    });
    const std::string why = ReasonText(work, options);
    rows.push_back({0, score, std::move(work), why});
  }
  std::ranges::stable_sort(rows, [](const WorkRow& a, const WorkRow& b) {
    return a.score != b.score ? a.score > b.score
                              : a.work.valve_id < b.work.valve_id;
  });
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].rank = static_cast<int>(i) + 1;
  }
  return rows;
}

std::string ReasonText(const ValveWork& work, const WorkOptions& options) {
  std::vector<WeightedText> texts = TextsOf(work, options);
  std::ranges::stable_sort(texts, std::greater{}, &WeightedText::weight);
  return JoinText(texts, "; ", &WeightedText::text);
}

std::vector<WorkRow> ReadWorkList(storage::History& history,
                                  const report::FaultTexts& texts,
                                  const WorkQuery& query) {
  if (!query.discipline.empty()) {
    RequireDiscipline(query.discipline);
  }
  std::map<std::string, ValveWork> valves;
  const std::vector<Episode> episodes = EpisodesOf(history, query);
  // What is shelved has been put aside by somebody who knows of it.
  const auto shelves = history.Shelves(query.options.now_ns);
  const auto shelved = [&shelves, &query](const Episode& episode) {
    return std::ranges::any_of(shelves, [&](const auto& s) {
      return IsActive(s, query.options.now_ns) && Covers(s, episode);
    });
  };
  for (const Episode& episode : episodes) {
    if (episode.label != "false" && !shelved(episode)) {
      ValveWork& work = valves[episode.valve_id];
      AddEpisode(episode, texts, work.faults);
      work.host = episode.host;
      work.monitor = episode.monitor;
    }
  }
  // Episodes labelled false count here although they are no reasons: they are
  // what speaks against a diagnosis.
  const std::map<std::string, Record> records = RecordsOf(episodes);
  for (const std::string& valve : history.HealthValves(query.valve_glob)) {
    AddHealth(history.Health({valve, query.since_ns}), texts, query,
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
      // A limit or a drift belongs to no discipline.
      facts.trends.clear();
      facts.drifts.clear();
      std::erase_if(facts.figures, [&query](const FigureReason& reason) {
        return query.discipline != DisciplineName(reason.text.discipline);
      });
    }
    work.push_back(std::move(facts));
  }
  std::vector<WorkRow> rows = RankWork(std::move(work), query.options);
  if (query.top != 0 && rows.size() > query.top) {
    rows.resize(query.top);
  }
  return rows;
}

report::Report WorkListReport(std::span<const WorkRow> rows) {
  report::Report report;
  Json& list = report.document["rows"] = Json::array();
  for (const WorkRow& row : rows) {
    list.push_back(RowJson(row));
    report.Line(RowText(row));
  }
  if (rows.empty()) {
    report.Line("Nothing to do.");
  }
  std::vector<std::string> keys = {
      "rank",         "valve_id",       "score",
      "severity",     "discipline",     "namur",
      "fault",        "name",           "why",
      "check",        "strength",       "open",
      "episodes",     "episode_id",     "confirmed",
      "detected_utc", "travel_strokes", "service_hours"};
  if (!list.empty() && list.front().contains("monitor")) {
    keys.insert(keys.end(), {"host", "monitor"});
  }
  return report.Csv("rows", keys);
}

}  // namespace fdi::planner
