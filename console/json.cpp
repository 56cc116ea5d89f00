#include "console/json.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/shown_state.h"
#include "storage/database/database.h"

namespace fdi::console {
namespace {

constexpr int kReadingDecimals = 4;
constexpr int kFactorDecimals = 3;

Json Reading(const TracePoint& point, Signal signal) {
  return ReadingJson(point.sample, signal, kReadingDecimals);
}

std::string_view QualityOf(const ValveState& valve) {
  switch (valve.silence) {
    case monitor::Silence::kStale:
      return "STALE";
    case monitor::Silence::kEnded:
      return "ENDED";
    case monitor::Silence::kMonitor:
      return "MONITOR_SILENT";
    case monitor::Silence::kNone:
      break;
  }
  return QualityName(valve.quality);
}

std::vector<std::string> FaultsOf(const ValveState& valve) {
  std::vector<std::string> faults;
  for (std::size_t f = 0; valve.models && f < valve.models->faults.size();
       ++f) {
    if ((valve.isolated >> f & 1U) != 0) {
      faults.push_back(valve.models->faults[f]);
    }
  }
  return faults;
}

Json SignalsJson(SignalMask signals) {
  Json names = Json::array();
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    if ((signals & MaskOf(static_cast<Signal>(s))) != 0) {
      names.push_back(SignalName(static_cast<Signal>(s)));
    }
  }
  return names;
}

// Why the newest sample did not reach the observers.
Json RefusedJson(const ValveState& valve) {
  if (valve.intake == Intake::kAccepted) {
    return {};
  }
  return {{"reason", IntakeName(valve.intake)},
          {"signals", SignalsJson(valve.refused)},
          {"flow_unit", valve.models ? FlowUnitName(valve.models->flow_unit)
                                     : std::string_view()}};
}

// Certainty of the alarm; a name that the alarm lacks has its own.
Json CertaintyJson(const ValveState& valve, const std::string& fault,
                   const ValveAlarm& alarm) {
  if (valve.state == State::kNormal && !alarm.unconfirmed_ns &&
      !alarm.by_audit) {
    return {};
  }
  return CertaintyName(
      fault.empty() || fault == alarm.fault
          ? alarm.certainty
          : CertaintyOf(fault, Layer::kObservers, valve.factor));
}

Json RoundedList(const std::vector<double>& values, int decimals) {
  Json list = Json::array();
  for (const double value : values) {
    list.push_back(Rounded(value, decimals));
  }
  return list;
}

Json ChannelsJson(const ModelFacts& models) {
  Json channels = Json::array();
  for (const ModelFacts::Channel& channel : models.channels) {
    channels.push_back({{"name", channel.name},
                        {"unit", channel.unit},
                        {"low", channel.low},
                        {"high", channel.high}});
  }
  return channels;
}

// Appends to each column its value in `row`; null where a point has none.
void AppendTo(Json& columns, const std::vector<double>& row, int decimals) {
  for (std::size_t c = 0; c < columns.size(); ++c) {
    columns[c].push_back(c < row.size() ? Rounded(row[c], decimals) : Json());
  }
}

// A stamp of 0 means that there is none.
Json MsOrNull(std::int64_t stamp_ns) {
  return stamp_ns == 0 ? Json() : Ms(stamp_ns);
}

std::string_view StateOf(const storage::Episode& episode) {
  if (episode.ended_ns) {
    return "CLOSED";
  }
  if (episode.cleared_ns) {
    return "CLEARED";
  }
  return episode.isolated_ns ? "ISOLATED" : "DETECTED";
}

}  // namespace

Json Ms(std::int64_t stamp_ns) {
  return stamp_ns / 1'000'000;
}

Json Ms(const std::optional<std::int64_t>& stamp_ns) {
  return stamp_ns ? Ms(*stamp_ns) : Json();
}

Json Rounded(double value, int decimals) {
  if (!std::isfinite(value)) {
    return {};
  }
  const double scale = std::pow(10.0, decimals);
  const double rounded = std::round(value * scale) / scale;
  return rounded == 0.0 ? 0.0 : rounded;  // No "-0.0".
}

Json Rounded(const std::optional<double>& value, int decimals) {
  return value ? Rounded(*value, decimals) : Json();
}

Json ReadingJson(const Sample& sample, Signal signal, int decimals) {
  constexpr int kDigits = 7;
  constexpr int kMostDecimals = 15;
  if (!sample.Has(signal)) {
    return {};
  }
  const double size = std::abs(sample[signal]);
  const bool own = signal == Signal::kPv ||
                   (signal == Signal::kSp && sample.Has(Signal::kPv));
  if (own && std::isfinite(size) && size > 0.0) {
    const int before = static_cast<int>(std::floor(std::log10(size))) + 1;
    decimals = std::clamp(kDigits - before, 0, kMostDecimals);
  }
  return Rounded(sample[signal], decimals);
}

Json TextOrNull(const std::string& text) {
  return text.empty() ? Json() : Json(text);
}

Json TextOrNull(const std::optional<std::string>& text) {
  return TextOrNull(text.value_or(""));
}

Json TileJson(const ValveState& valve, const ValveAlarm& alarm,
              bool newest_only) {
  const bool named = valve.isolated != 0;
  const bool audited = alarm.by_audit && valve.state == State::kNormal;
  const std::vector<std::string> faults =
      audited ? std::vector{alarm.fault} : FaultsOf(valve);
  Json tile = {
      {"id", valve.id},
      {"state",
       ShownState(audited ? State::kIsolated : valve.state,
                  valve.silence == monitor::Silence::kNone ? valve.quality
                                                           : Quality::kStale,
                  valve.blind || !valve.unjudged.empty() || valve.contested)},
      {"quality", QualityOf(valve)},
      {"reasons", CoverageReasonsName(valve.reasons)},
      {"missing", SignalsJson(valve.missing)},
      {"unjudged", valve.unjudged},
      {"unjudged_since_ms", MsOrNull(valve.unjudged_ns)},
      {"why", TextOrNull(valve.why)},
      {"blind", valve.blind},
      {"contested", valve.contested},
      {"notice", valve.notice},
      {"refused", RefusedJson(valve)},
      {"faults", faults},
      {"certainty", CertaintyJson(valve, JoinText(faults, "|"), alarm)},
      {"factor", named ? Rounded(valve.factor, kFactorDecimals) : Json()},
      // As the alarm has it, if there is one.
      {"strength", alarm.strength ? Rounded(*alarm.strength, kFactorDecimals)
                   : named        ? Rounded(valve.strength, kFactorDecimals)
                                  : Json()},
      {"severity",
       alarm.severity ? Json(SeverityName(*alarm.severity)) : Json()},
      {"unconfirmed_ms", Ms(alarm.unconfirmed_ns)},
      {"fault", TextOrNull(alarm.fault)},
      {"look_alikes", alarm.look_alikes},
      {"second", TextOrNull(alarm.second)},
      {"d0", Rounded(valve.d0, kFactorDecimals)},
      {"stamp_ms", MsOrNull(valve.stamp_ns)},
      {"since_ms", Ms(alarm.since_ns)},
      {"episode", TextOrNull(alarm.episode)},
      {"model_set", valve.models ? Json(valve.models->model_set) : Json()},
      {"shelved_until_ms", Ms(alarm.shelved_until_ns)},
      {"shelf_planned_ms", Ms(alarm.shelf_planned_ns)},
      {"active", alarm.active},
      {"unacked", alarm.unacked}};
  if (!valve.monitor.empty()) {
    tile["monitor"] = valve.monitor;
    tile["monitor_silent_since_ms"] =
        valve.silence == monitor::Silence::kMonitor ? Ms(valve.heard_ns)
                                                    : Json();
  }
  if (newest_only) {
    tile["v"] = valve.spark.empty()
                    ? Json()
                    : Rounded(valve.spark.back(), kFactorDecimals);
  } else {
    tile["spark"] = RoundedList(valve.spark, kFactorDecimals);
  }
  return tile;
}

Json ModelFactsJson(const ModelFacts& models) {
  return {{"model_set", models.model_set},
          {"hash", storage::EpisodeIdText(models.hash)},
          {"channels", ChannelsJson(models)},
          {"faults", models.faults},
          {"undetectable", models.undetectable},
          {"T", models.isolation_threshold},
          {"t_k", models.isolation_samples},
          {"n_d", models.detection_samples},
          {"period_s", models.period_s}};
}

Json SampleJson(const std::string& valve_id, const TracePoint& point) {
  Json sample = {{"valve", valve_id}, {"t_ms", Ms(point.sample.stamp_ns)}};
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if (point.sample.Has(signal)) {
      sample[Lower(SignalName(signal))] = Reading(point, signal);
    }
  }
  sample["residuals"] = RoundedList(point.residuals, kReadingDecimals);
  sample["d0"] = Rounded(point.normal_factor, kFactorDecimals);
  sample["d"] = RoundedList(point.factors, kFactorDecimals);
  sample["state"] = StateName(point.state);
  sample["quality"] = QualityName(point.quality);
  return sample;
}

Json TrendJson(const ModelFacts* models, const std::string& valve_id,
               const std::vector<TracePoint>& points) {
  static const ModelFacts kNoModels;
  const ModelFacts& facts = models != nullptr ? *models : kNoModels;
  Json trend = {
      {"valve", valve_id},
      {"model_set", TextOrNull(facts.model_set)},
      {"channels", ChannelsJson(facts)},
      {"faults", facts.faults},
      {"T", models != nullptr ? Json(facts.isolation_threshold) : Json()}};
  for (const char* key : {"t_ms", "d0", "state", "quality"}) {
    trend[key] = Json::array();
  }
  trend["residuals"] = Json(facts.channels.size(), Json::array());
  trend["d"] = Json(facts.faults.size(), Json::array());
  SignalMask present = 0;
  for (const TracePoint& point : points) {
    present = static_cast<SignalMask>(present | point.sample.present);
    trend["t_ms"].push_back(Ms(point.sample.stamp_ns));
    AppendTo(trend["residuals"], point.residuals, kReadingDecimals);
    trend["d0"].push_back(Rounded(point.normal_factor, kFactorDecimals));
    AppendTo(trend["d"], point.factors, kFactorDecimals);
    trend["state"].push_back(StateName(point.state));
    trend["quality"].push_back(QualityName(point.quality));
  }
  // A column for each signal that any of the points has.
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    for (std::size_t i = 0;
         (present & MaskOf(signal)) != 0 && i < points.size(); ++i) {
      trend[Lower(SignalName(signal))].push_back(Reading(points[i], signal));
    }
  }
  trend["flow_unit"] = FlowUnitName(
      points.empty() ? FlowUnit::kM3PerHour : points.back().sample.flow_unit);
  return trend;
}

Json GapJson(const DataGap& gap) {
  return {{"valve", TextOrNull(gap.valve_id)},
          {"from_ms", Ms(gap.from_ns)},
          {"to_ms", Ms(gap.to_ns)},
          {"reason", gap.reason}};
}

Json ShelfJson(const storage::Shelf& shelf) {
  return {{"shelf_id", shelf.shelf_id},
          {"valve", shelf.valve_id},
          {"fault", TextOrNull(shelf.fault)},
          {"from_ms", Ms(shelf.from_ns)},
          {"until_ms", Ms(shelf.until_ns)},
          {"who", shelf.who},
          {"comment", shelf.comment},
          {"origin", shelf.origin},
          {"ended_ms", Ms(shelf.ended_ns)},
          {"ended_by", TextOrNull(shelf.ended_by)},
          {"planned_ms", Ms(shelf.planned_ns)}};
}

Json AlarmJson(const storage::Alarm& alarm, const report::FaultTexts& texts,
               const findings::RankFacts& facts) {
  const storage::Episode& e = alarm.episode;
  const findings::Finding finding = findings::FindingOf(e, texts, facts);
  const report::FaultWords& words = finding.words;
  const auto strength = [&e](std::optional<double> value) {
    return IsNamed(e) ? Rounded(value, kFactorDecimals) : Json();
  };
  Json json{{"episode", e.episode_id},
            {"valve", e.valve_id},
            {"about", findings::AboutJson(finding.about)},
            {"fault", TextOrNull(e.fault)},
            {"certainty", CertaintyName(*finding.certainty)},
            {"look_alikes", finding.look_alikes},
            {"witness", finding.witness},
            {"second", TextOrNull(e.second)},
            {"layer", TextOrNull(e.layer)},
            {"state", StateOf(e)},
            {"isa", storage::AlarmStateName(alarm.state)},
            {"return_h", Rounded(e.return_hours, 0)},
            {"shelved", alarm.shelf ? ShelfJson(*alarm.shelf) : Json()},
            {"detected_ms", Ms(e.detected_ns)},
            {"isolated_ms", Ms(e.isolated_ns)},
            {"cleared_ms", Ms(e.cleared_ns)},
            {"ended_ms", Ms(e.ended_ns)},
            {"returned_ms", Ms(finding.ended_ns)},
            {"end_reason", TextOrNull(e.end_reason)},
            {"peak_factor", Rounded(e.peak_factor, kFactorDecimals)},
            {"strength", strength(e.strength)},
            {"lowest", strength(e.lowest)},
            {"highest", strength(e.highest)},
            {"worst_strength", strength(e.worst_strength)},
            {"unconfirmed_ms", Ms(e.unconfirmed_ns)},
            {"label", TextOrNull(e.label)},
            {"acked_by", TextOrNull(e.acked_by)},
            {"acked_ms", Ms(e.acked_ns)},
            {"ack_comment", TextOrNull(e.ack_comment)},
            {"model_set", e.model_set},
            {"severity", SeverityName(words.severity)},
            {"priority", PriorityOf(words.severity)},
            {"score", finding.score()},
            {"discipline", words.discipline},
            {"namur", report::NamurName(words.namur)},
            {"name", words.name},
            {"check", words.check}};
  if (!e.monitor.empty()) {
    json.update({{"host", e.host}, {"monitor", e.monitor}});
  }
  return json;
}

Json AlarmsJson(const std::vector<storage::Alarm>& alarms,
                const report::FaultTexts& texts,
                const findings::RankFacts& facts) {
  Json list = Json::array();
  for (const storage::Alarm& alarm : alarms) {
    list.push_back(AlarmJson(alarm, texts, facts));
  }
  return list;
}

}  // namespace fdi::console
