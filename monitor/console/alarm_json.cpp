// Alarms and shelves of the history as JSON.
#include "diagnosis/fault_catalogue.h"
#include "monitor/console/json.h"

namespace fdi::console {
namespace {

Json OptionalText(const std::optional<std::string>& text) {
  return text ? Json(*text) : Json();
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

Json ShelfJson(const storage::Shelf& shelf) {
  return {{"shelf_id", shelf.shelf_id},
          {"valve", shelf.valve_id},
          {"fault", OptionalText(shelf.fault)},
          {"from_ms", Ms(shelf.from_ns)},
          {"until_ms", Ms(shelf.until_ns)},
          {"who", shelf.who},
          {"comment", shelf.comment},
          {"origin", shelf.origin},
          {"ended_ms", Ms(shelf.ended_ns)},
          {"ended_by", TextOrNull(shelf.ended_by)}};
}

Json AlarmJson(const storage::Alarm& alarm, const cli::FaultTexts& texts) {
  const storage::Episode& e = alarm.episode;
  const cli::FaultWords words =
      texts.Words(e.fault.value_or("unknown"), e.strength);
  Json json = {{"episode", e.episode_id},
               {"valve", e.valve_id},
               {"fault", OptionalText(e.fault)},
               {"state", StateOf(e)},
               {"isa", storage::AlarmStateName(alarm.state)},
               {"shelved", alarm.shelf ? ShelfJson(*alarm.shelf) : Json()},
               {"detected_ms", Ms(e.detected_ns)},
               {"isolated_ms", Ms(e.isolated_ns)},
               {"cleared_ms", Ms(e.cleared_ns)},
               {"ended_ms", Ms(e.ended_ns)},
               {"end_reason", OptionalText(e.end_reason)},
               {"peak_factor", Rounded(e.peak_factor, 3)},
               {"strength", Rounded(e.strength, 3)},
               {"label", OptionalText(e.label)},
               {"acked_by", OptionalText(e.acked_by)},
               {"acked_ms", Ms(e.acked_ns)},
               {"model_set", e.model_set}};
  json["severity"] = cli::SeverityName(words.severity);
  json["discipline"] = words.discipline;
  json["namur"] = cli::NamurName(words.namur);
  json["name"] = words.name;
  json["check"] = words.check;
  return json;
}

storage::Alarm AlarmOf(const monitor::EpisodeEvent& event) {
  storage::Alarm alarm;
  storage::Episode& e = alarm.episode;
  const Transition& transition = event.transition;
  e.id = event.episode_id;
  e.episode_id = storage::EpisodeIdText(event.episode_id);
  e.valve_id = event.valve_id;
  e.detected_ns = transition.detection_stamp_ns;
  e.peak_factor = transition.factor;
  e.strength = transition.strength;
  e.model_set = event.model_set + "@" + std::to_string(event.model_version);
  std::string faults;
  for (const monitor::Candidate& candidate : event.candidates) {
    if (candidate.isolated) {
      faults.append(faults.empty() ? "" : "|")
          .append(FaultName(candidate.fault));
    }
  }
  if (!faults.empty()) {
    e.fault = faults;
    e.isolated_ns = transition.stamp_ns;
  }
  if (transition.kind == TransitionKind::kCleared) {
    e.cleared_ns = transition.stamp_ns;
  } else if (transition.kind == TransitionKind::kClosed) {
    e.ended_ns = transition.stamp_ns;
    e.end_reason = EndReasonName(transition.reason);
  }
  alarm.state = storage::AlarmStateOf(e);
  return alarm;
}

}  // namespace fdi::console
