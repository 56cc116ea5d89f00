#include "monitor/bus/watch_records.h"

#include <algorithm>
#include <optional>
#include <sstream>

#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/severity.h"
#include "diagnosis/model/shown_state.h"
#include "report/text_table.h"
#include "storage/history/episode.h"

namespace fdi::monitor {
namespace {

using report::FormatNumber;
using report::Json;

std::string Hex(std::uint64_t value) {
  return storage::EpisodeIdText(value);  // 16 digits
}

Json Utc(std::int64_t stamp_ns) {
  return FormatTime(stamp_ns, true);
}

// "f6 or f18"
std::string WithOr(std::string faults,
                   const std::vector<std::string>& look_alikes) {
  for (const std::string& other : look_alikes) {
    faults += " or " + other;
  }
  return faults;
}

// "likely f19 strength=0.52", "not yet, may be f3|f6"
std::string NameText(const FaultEvent& message, const std::string& faults,
                     const std::vector<std::string>& look_alikes) {
  std::string text(
      CertaintyName(WithLookAlikes(CertaintyOf(message), look_alikes)));
  if (!faults.empty()) {
    return text + " " + WithOr(faults, look_alikes) +
           " strength=" + FormatNumber(message.transition.strength, 2);
  }
  const std::string names =
      JoinText(message.candidates, "|", [](const FaultCandidate& candidate) {
        return FaultName(candidate.fault);
      });
  return names.empty() ? text : text + ", may be " + names;
}

}  // namespace

// "2026-11-20T14:56:11Z V1"
std::string WatchRecords::Start(std::int64_t stamp_ns,
                                const std::string& who) const {
  return FormatTime(stamp_ns, utc_) + " " + who;
}

void WatchRecords::Add(const idl::DecisionMessage& message,
                       Clock::time_point now) {
  waiting_.emplace_back(now, message);
  Flush(now);
}

// Vectors are written in the order of their arrival, each once its model set is
// known and gives its numbers names, or without names after kPatience.
void WatchRecords::Flush(Clock::time_point now) {
  while (!waiting_.empty() && (names_.Explains(waiting_.front().second) ||
                               now - waiting_.front().first >= kPatience)) {
    sink_(RecordOf(waiting_.front().second));
    waiting_.pop_front();
  }
}

WatchRecord WatchRecords::RecordOf(const idl::DecisionMessage& message) const {
  const Verdict& v = message.verdict;
  const std::string state(ShownState(v));
  const Json residuals = names_.Residuals(message);
  const Json factors = names_.Factors(message);
  std::string line = Start(v.stamp_ns, message.valve_id) + " " +
                     std::string(QualityName(v.quality)) + " " + state;
  for (const auto& [name, residual] : residuals.items()) {
    line += " r_" + name + "=" + FormatNumber(residual.get<double>(), 3);
  }
  Json isolated = Json::array();
  std::string faults;
  double largest = 0.0;
  double strength = 0.0;
  std::size_t bit = 0;
  for (const auto& [name, factor] : factors.items()) {
    if (Has(v.isolated, bit)) {
      isolated.push_back(name);
      faults += (faults.empty() ? "" : "|") + name;
      largest = std::max(largest, factor.get<double>());
      strength = v.strengths[bit];
    }
    ++bit;
  }
  Json certainty;
  std::vector<std::string> look_alikes;
  if (v.state != State::kNormal) {
    look_alikes = LookAlikesBeside(faults, Layer::kObservers, strength,
                                   names_.KnownTo(message.model_hash));
    certainty = CertaintyName(WithLookAlikes(
        CertaintyOf(faults, Layer::kObservers, largest), look_alikes));
    line += " " + certainty.get<std::string>() +
            (faults.empty() ? "" : " " + WithOr(faults, look_alikes));
  }
  return {{{"topic", "DecisionVector"},
           {"valve_id", message.valve_id},
           {"source_id", Hex(v.source_id)},
           {"seq", v.seq},
           {"stamp_utc", Utc(v.stamp_ns)},
           {"model_hash", Hex(message.model_hash)},
           {"quality", QualityName(v.quality)},
           {"state", state},
           {"detected", v.detected},
           {"confidence", v.confidence},
           {"normal_factor", v.normal_factor},
           {"residuals", residuals},
           {"factors", factors},
           {"isolated", std::move(isolated)},
           {"certainty", std::move(certainty)},
           {"look_alikes", std::move(look_alikes)}},
          line};
}

// On the bus, a rise of priority is an isolation of the same faults.
TransitionKind WatchRecords::KindOf(const FaultEvent& message) {
  constexpr std::size_t kMaxEpisodes = 10'000;
  const Transition& t = message.transition;
  const auto before = names_of_episodes_.find(message.episode_id);
  const bool same = t.kind == TransitionKind::kReisolated &&
                    before != names_of_episodes_.end() &&
                    before->second == t.faults;
  if (t.kind == TransitionKind::kClosed ||
      names_of_episodes_.size() >= kMaxEpisodes) {
    names_of_episodes_.erase(message.episode_id);
  } else {
    names_of_episodes_[message.episode_id] = t.faults;
  }
  return same ? TransitionKind::kChanged : t.kind;
}

void WatchRecords::Add(const FaultEvent& message, Clock::time_point /*now*/) {
  const Transition& t = message.transition;
  const std::string faults = IsolatedFaults(message);
  const std::vector<std::string> look_alikes = LookAlikesBeside(
      faults, t.layer, t.strength, names_.KnownTo(message.model_hash));
  Json candidates = Json::array();
  for (const FaultCandidate& candidate : message.candidates) {
    candidates.push_back({{"fault", FaultName(candidate.fault)},
                          {"factor", candidate.factor},
                          {"strength", candidate.strength},
                          {"isolated", candidate.isolated}});
  }
  const std::string kind(TransitionName(KindOf(message)));
  const std::string reason(EndReasonName(t.reason));
  sink_({{{"topic", "FaultEvent"},
          {"valve_id", message.valve_id},
          {"episode_id", Hex(message.episode_id)},
          {"transition", kind},
          {"stamp_utc", Utc(t.stamp_ns)},
          {"detected_utc", Utc(t.detection_stamp_ns)},
          {"fault", faults.empty() ? "unknown" : faults},
          {"certainty",
           CertaintyName(WithLookAlikes(CertaintyOf(message), look_alikes))},
          {"look_alikes", look_alikes},
          {"factor", t.factor},
          {"strength", faults.empty() ? Json() : Json(t.strength)},
          {"reason", reason},
          {"candidates", std::move(candidates)},
          {"model_set",
           message.model_set + "@" + std::to_string(message.model_version)},
          {"persisted", message.persisted}},
         Start(t.stamp_ns, message.valve_id) + " EVENT " + kind + " " +
             NameText(message, faults, look_alikes) +
             " episode=" + Hex(message.episode_id) +
             (t.reason == EndReason::kNone ? "" : " reason=" + reason) +
             (message.persisted ? "" : " NOT_PERSISTED")});
}

void WatchRecords::Add(const idl::MonitorStatusMessage& message,
                       Clock::time_point /*now*/) {
  const std::string health(idl::HealthName(message.health));
  std::string line = Start(message.stamp_ns, message.monitor) + " STATUS " +
                     health +
                     (message.text.empty() ? "" : " (" + message.text + ")");
  Json counters = Json::object();
  for (const auto& [name, value] : message.counters) {
    counters[name] = value;
    if (value != 0) {
      line += " " + name + "=" + std::to_string(value);
    }
  }
  sink_({{{"topic", "MonitorStatus"},
          {"monitor", message.monitor},
          {"software", message.software},
          {"started_utc", Utc(message.started_ns)},
          {"stamp_utc", Utc(message.stamp_ns)},
          {"health", health},
          {"text", message.text},
          {"counters", std::move(counters)}},
         line});
}

void WatchRecords::Add(const idl::ValveStateMessage& message,
                       Clock::time_point /*now*/) {
  const auto text = [](const std::string& value) {
    return value.empty() ? Json() : Json(value);
  };
  const auto utc = [](std::int64_t stamp_ns) {
    return stamp_ns == 0 ? Json() : Json(Utc(stamp_ns));
  };
  const bool named = !message.fault.empty() && message.fault != "unknown";
  const std::optional<Severity> severity = SeverityOf(message.priority);
  const std::string state(
      ShownState(message.state, message.quality, message.partly));
  Json look_alikes = Json::array();
  std::istringstream others(message.look_alikes);
  for (std::string other; std::getline(others, other, '|');) {
    look_alikes.push_back(other);
  }
  std::string line =
      Start(message.as_of_ns, message.valve_id) + " STATE " +
      (message.unconfirmed_ns == 0
           ? state
           : "not confirmed since " + FormatTime(message.unconfirmed_ns, utc_));
  if (message.unjudged_ns != 0) {
    line += " not judged since " + FormatTime(message.unjudged_ns, utc_) +
            " because " + message.why;
  }
  if (message.episode_id != 0) {
    line += " " + message.certainty + " " + message.fault +
            (named ? " strength=" + FormatNumber(message.strength, 2) : "") +
            " episode=" + Hex(message.episode_id);
  }
  sink_({{{"topic", "ValveState"},
          {"valve_id", message.valve_id},
          {"monitor", message.monitor},
          {"as_of_utc", utc(message.as_of_ns)},
          {"quality", QualityName(message.quality)},
          {"state", message.unconfirmed_ns == 0 ? state : "NOT_CONFIRMED"},
          {"unconfirmed_utc", utc(message.unconfirmed_ns)},
          {"unjudged_utc", utc(message.unjudged_ns)},
          {"why", text(message.why)},
          {"episode_id",
           message.episode_id == 0 ? Json() : Json(Hex(message.episode_id))},
          {"fault", text(message.fault)},
          {"look_alikes", std::move(look_alikes)},
          {"certainty", text(message.certainty)},
          {"layer", text(message.layer)},
          {"severity", severity ? Json(SeverityName(*severity)) : Json()},
          {"priority", severity ? Json(message.priority) : Json()},
          {"strength", named ? Json(message.strength) : Json()},
          {"since_utc", utc(message.since_ns)},
          {"model_set", text(message.model_set)}},
         line});
}

void WatchRecords::Add(const idl::ModelSetInfoMessage& message,
                       Clock::time_point now) {
  names_.Add(message);
  Json faults = Json::array();
  for (const int fault : message.faults) {
    faults.push_back(FaultName(fault));
  }
  Json channels = Json::array();
  for (const ChannelSpec& channel : message.channels) {
    channels.push_back(channel.name);
  }
  const std::string hash = Hex(message.model_hash);
  const std::string line =
      Start(message.created_ns, "MODELS ") + message.model_set + "@" +
      std::to_string(message.version) + " hash=" + hash +
      " channels=" + std::to_string(channels.size()) +
      " observers=" + std::to_string(message.observers.size());
  sink_({{{"topic", "ModelSetInfo"},
          {"model_set", message.model_set},
          {"version", message.version},
          {"model_hash", hash},
          {"sample_period_s", message.sample_period_s},
          {"channels", std::move(channels)},
          {"faults", std::move(faults)},
          {"observers", message.observers.size()}},
         line});
  Flush(now);
}

}  // namespace fdi::monitor
