#include "gateway/valve_states.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/severity.h"

namespace fdi::gateway {
namespace {

using report::Json;

constexpr std::chrono::minutes kRefresh(1);
// Events wait for the broker; beyond these the history has them.
constexpr std::size_t kMaxEvents = 10'000;

// NAMUR NE 107 in the words of OPC 10000-100, DeviceHealthEnumeration.
std::string_view HealthOf(report::NamurClass namur) {
  switch (namur) {
    case report::NamurClass::kFailure:
      return "FAILURE";
    case report::NamurClass::kOutOfSpecification:
      return "OFF_SPEC";
    case report::NamurClass::kMaintenanceRequired:
      return "MAINTENANCE_REQUIRED";
    case report::NamurClass::kCheckFunction:
      break;
  }
  return "CHECK_FUNCTION";
}

// Why a sample was not judged.
std::string ReasonOf(const Json& quality) {
  static constexpr std::pair<std::string_view, std::string_view> kReasons[] = {
      {"BAD_INPUT", "readings are missing or impossible"},
      {"SETTLING", "the diagnosis has just begun or begun again"},
      {"INHIBITED", "the valve is out of service or calibrating"},
      {"UNCOVERED", "it works where its models do not know it"},
      {"MODEL_UNSUITED", "its models do not suit it"},
      {"UNASSIGNED", "it has no models, and its loop is not judged yet"},
      {"STALE", "its readings have ended"}};
  std::string name =
      quality.is_string() ? quality.get<std::string>() : std::string("STALE");
  for (const auto& [known, reason] : kReasons) {
    if (name == known) {
      return std::string(reason);
    }
  }
  return name;
}

// "valve clogging" of f1; of several faults joined by "or".
std::string DescriptionOf(std::string_view answer) {
  std::string text;
  while (!answer.empty()) {
    const std::size_t bar = std::min(answer.find('|'), answer.size());
    for (const auto& fault : kFaultCatalogue) {
      if (fault.name == answer.substr(0, bar)) {
        text += (text.empty() ? "" : " or ") + std::string(fault.description);
      }
    }
    answer.remove_prefix(std::min(bar + 1, answer.size()));
  }
  return text;
}

}  // namespace

std::string TopicLevel(std::string_view valve_id) {
  std::string level;
  for (const char c : valve_id) {
    if (std::string_view("/+#%").find(c) != std::string_view::npos) {
      char code[4];
      std::snprintf(code, sizeof code, "%%%02X",
                    static_cast<unsigned>(static_cast<unsigned char>(c)));
      level += code;
    } else {
      level += c;
    }
  }
  return level;
}

std::string ValveOfLevel(std::string_view level) {
  std::string valve_id;
  for (std::size_t i = 0; i < level.size(); ++i) {
    const auto code = level[i] == '%'
                          ? ParseWhole<unsigned>(level.substr(i + 1, 2), 16)
                          : std::nullopt;
    valve_id += code ? static_cast<char>(*code) : level[i];
    i += code ? 2 : 0;
  }
  return valve_id;
}

void ValveStates::Add(const Json& record, Clock::time_point now) {
  table_.Add(record, now);
  if (record["topic"] == "FaultEvent" && new_events_.size() < kMaxEvents) {
    new_events_.push_back(record);
  }
}

void ValveStates::TakeKept(const MqttEvent& event) {
  std::string_view level = event.topic;
  constexpr std::string_view kState = "/state";
  if (!event.retained || event.payload.empty() || !level.starts_with(prefix_)) {
    return;
  }
  level.remove_prefix(prefix_.size());
  if (level.ends_with(kState)) {
    Expect(ValveOfLevel(level.substr(0, level.size() - kState.size())));
  }
}

std::vector<Outgoing> ValveStates::Due(std::int64_t now_ns,
                                       Clock::time_point now, bool missing) {
  std::vector<Outgoing> due;
  for (Json& event : std::exchange(new_events_, {})) {
    // The bus may tell an event twice, and a broker, too.
    event["id"] = event["episode_id"].get<std::string>() + "/" +
                  event["transition"].get<std::string>() + "/" +
                  event["stamp_utc"].get<std::string>();
    due.push_back(
        {prefix_ + TopicLevel(event["valve_id"].get<std::string>()) + "/event",
         report::JsonText(event), false});
  }
  const Json document = table_.Valves(now_ns, now).document;
  const bool monitored = !document["monitor"].is_null();
  Tell(prefix_ + "monitor", {{"alive", true}, {"monitor", document["monitor"]}},
       document["as_of_utc"], now, due);
  std::set<std::string> known;
  for (const Json& row : document["valves"]) {
    const auto valve_id = row["valve_id"].get<std::string>();
    known.insert(valve_id);
    Tell(prefix_ + TopicLevel(valve_id) + "/state", StateOf(row, monitored),
         row["as_of_utc"], now, due);
  }
  for (const std::string& valve_id : expected_) {
    if (missing && !known.contains(valve_id)) {
      Json state = KnownOf(valve_id);
      state["health"] = "CHECK_FUNCTION";
      state["reason"] = "no monitor tells of it";
      Tell(prefix_ + TopicLevel(valve_id) + "/state", std::move(state), Json(),
           now, due);
    }
  }
  valves_ = known.size();
  // A valve that goes must not stay as it was told last.
  expected_.merge(known);
  return due;
}

void ValveStates::SetAlarms(
    const std::optional<std::vector<storage::Alarm>>& alarms) {
  has_history_ = alarms.has_value();
  alarms_.clear();
  if (!alarms) {
    return;
  }
  for (const storage::Alarm& alarm : *alarms) {
    const std::string& valve_id = alarm.episode.valve_id;
    expected_.insert(valve_id);
    alarms_.try_emplace(valve_id, Json::array())
        .first->second.push_back(AlarmOf(alarm));
  }
}

Json ValveStates::AlarmOf(const storage::Alarm& alarm) const {
  const storage::Episode& episode = alarm.episode;
  const report::FaultWords words = findings::FindingOf(episode, texts_).words;
  const auto time = [](const std::optional<std::int64_t>& stamp_ns) {
    return stamp_ns ? Json(FormatTime(*stamp_ns, true)) : Json();
  };
  const auto text = [](const std::optional<std::string>& value) {
    return value ? Json(*value) : Json();
  };
  return {{"episode_id", episode.episode_id},
          {"state", storage::AlarmStateName(alarm.state)},
          {"health", HealthOf(words.namur)},
          {"fault", text(episode.fault)},
          {"name", words.name},
          {"check", words.check},
          {"severity", SeverityName(words.severity)},
          {"detected_utc", time(episode.detected_ns)},
          {"unconfirmed_utc", time(episode.unconfirmed_ns)},
          {"acked_by", text(episode.acked_by)},
          {"acked_utc", time(episode.acked_ns)},
          {"ack_comment", text(episode.ack_comment)},
          {"shelved_until_utc",
           alarm.shelf ? time(alarm.shelf->until_ns) : Json()}};
}

// All that is known of a valve beside what monitors tell.
Json ValveStates::KnownOf(const std::string& valve_id) const {
  const auto group = groups_.find(valve_id);
  const auto alarms = alarms_.find(valve_id);
  return {{"valve_id", valve_id},
          {"group", group == groups_.end() ? Json() : Json(group->second)},
          {"about",
           findings::AboutJson(findings::IdentityOf(identities_, valve_id))},
          {"alarms", alarms != alarms_.end() ? alarms->second
                     : has_history_          ? Json::array()
                                             : Json()}};
}

Json ValveStates::StateOf(const Json& row, bool monitored) const {
  const auto valve_id = row["valve_id"].get<std::string>();
  const auto state = row["state"].get<std::string>();
  const bool alarm = row["certainty"].is_string();
  const std::string fault =
      row["fault"].is_string() ? row["fault"].get<std::string>() : "";
  const double strength =
      row["strength"].is_number() ? row["strength"].get<double>() : 0.0;
  // An alarm without a name yet is one unlike any known fault as far as anybody
  // knows.
  const report::FaultWords words =
      texts_.Words(fault.empty() ? "unknown" : fault, strength,
                   alarm ? std::optional(row["priority"].get<std::int64_t>())
                         : std::nullopt);
  std::string health = "NORMAL";
  Json reason;
  if (!monitored) {
    health = "CHECK_FUNCTION";
    reason = "no monitor is heard";
  } else if (state == "NOT_CONFIRMED") {
    health = "CHECK_FUNCTION";
    reason = "no data since " + row["unconfirmed_utc"].get<std::string>();
  } else if (alarm) {
    health = HealthOf(words.namur);
  } else if (state == "PARTLY_JUDGED") {
    health = "CHECK_FUNCTION";
    reason = "judged in part: a reading that its models need is missing";
  } else if (state != "NORMAL") {
    health = "CHECK_FUNCTION";
    reason = ReasonOf(row["quality"]);
    if (!row["unjudged_utc"].is_null()) {
      reason = reason.get<std::string>() + ": not judged since " +
               row["unjudged_utc"].get<std::string>() + " because " +
               row["why"].get<std::string>();
    }
  }
  const auto when = [&](bool shown, Json value) {
    return shown ? std::move(value) : Json();
  };
  Json known = KnownOf(valve_id);
  known.update(
      {{"health", health},
       {"reason", reason},
       {"state", state},
       {"fault", row["fault"]},
       {"name", when(alarm && !fault.empty(), words.name)},
       {"description",
        when(!DescriptionOf(fault).empty(), DescriptionOf(fault))},
       {"certainty", row["certainty"]},
       {"look_alikes", row["look_alikes"]},
       {"strength_pct", when(row["strength"].is_number(),
                             std::round(1000.0 * strength) / 10.0)},
       {"severity", when(alarm, std::string(SeverityName(words.severity)))},
       {"priority", when(alarm, PriorityOf(words.severity))},
       {"since_utc", row["since_utc"]},
       {"check", when(alarm && !fault.empty(), words.check)},
       {"model_set", row["model_set"]}});
  return known;
}

void ValveStates::Tell(const std::string& topic, Json state, const Json& as_of,
                       Clock::time_point now, std::vector<Outgoing>& due) {
  std::string payload = report::JsonText(state);
  Published& last = published_[topic];
  if (payload == last.payload && now - last.at < kRefresh) {
    return;
  }
  last = {std::move(payload), now};
  state["as_of_utc"] = as_of;
  due.push_back({topic, report::JsonText(state), true});
}

Outgoing ValveStates::Farewell() const {
  return {prefix_ + "monitor",
          report::JsonText({{"alive", false}, {"monitor", Json()}}), true};
}

}  // namespace fdi::gateway
