#include "monitor/bus/bus_valve_states.h"

#include <algorithm>
#include <utility>

#include "base/text.h"
#include "storage/history/alarm.h"

namespace fdi::monitor {
namespace {

// A state that lasts is told again as often, by the time of the samples,
// because its as_of goes on. Each time costs one message.
constexpr std::int64_t kRefreshNs = 10'000'000'000;

bool IsFresh(std::int64_t as_of_ns, std::int64_t told_ns) {
  return as_of_ns >= told_ns && as_of_ns - told_ns < kRefreshNs;
}

std::uint64_t EpisodeOf(const findings::Finding& alarm) {
  return storage::ParseEpisodeId(alarm.episode_id).value_or(0);
}

// Adds the alarm to the state of its valve.
void AddAlarm(const findings::Finding& alarm, idl::ValveStateMessage& state) {
  const bool named = alarm.strength.has_value();
  state.state = named ? State::kIsolated : State::kDetected;
  state.episode_id = EpisodeOf(alarm);
  if (named || alarm.certainty == Certainty::kNotKnown) {
    state.fault = alarm.fault.value_or("unknown");
  }
  state.look_alikes = JoinText(alarm.look_alikes, "|");
  state.certainty = CertaintyName(*alarm.certainty);
  state.layer = alarm.layer.value_or("");
  state.priority = PriorityOf(alarm.words.severity);
  state.strength = alarm.strength.value_or(0.0);
  state.since_ns = *alarm.since_ns;
}

}  // namespace

BusValveStates::BusValveStates(idl::Participant& participant,
                               std::string monitor, report::FaultTexts texts)
    : monitor_(std::move(monitor)),
      texts_(std::move(texts)),
      publisher_(participant, {.replaces = true}) {}

void BusValveStates::Recover(const storage::Episode& episode) {
  const MutexLock lock(mutex_);
  Valve& valve = valves_[episode.valve_id];
  // An open episode takes the place of one that its data left unconfirmed.
  if (valve.alarm && episode.ended_ns) {
    return;
  }
  valve.alarm = findings::FindingOf(episode, texts_);
  valve.audit = episode.audit;
  valve.model_set = episode.model_set;
  valve.left = true;
  valve.as_of_ns = valve.alarm->unconfirmed_ns.value_or(valve.alarm->last_ns);
  Tell(episode.valve_id, valve);
}

void BusValveStates::OnEvent(const FaultEvent& event) {
  if (event.resent) {
    return;  // Of an earlier session, whose alarms are recovered.
  }
  storage::Episode episode = storage::AlarmOf(event).episode;
  const MutexLock lock(mutex_);
  Valve& valve = valves_[event.valve_id];
  episode.audit = valve.audit;
  const bool over = episode.cleared_ns || episode.ended_ns;
  // The valve may have been found normal before its events were stored.
  if (episode.notice) {
    // An alarm that its data left unconfirmed stands beside it.
  } else if (over && (!episode.unconfirmed_ns ||
                      valve.normal_ns > *episode.unconfirmed_ns)) {
    valve.alarm.reset();
  } else {
    valve.alarm = findings::FindingOf(episode, texts_);
    valve.left = over;
  }
  if (event.transition.kind == TransitionKind::kClosed) {
    valve.audit = IsTakenOver(episode) ? episode.fault : std::nullopt;
  }
  Tell(event.valve_id, valve);
}

std::vector<std::uint64_t> BusValveStates::Unconfirmed() const {
  const MutexLock lock(mutex_);
  std::vector<std::uint64_t> episodes;
  for (const auto& [valve_id, valve] : valves_) {
    if (valve.left && valve.alarm) {
      episodes.push_back(EpisodeOf(*valve.alarm));
    }
  }
  return episodes;
}

void BusValveStates::EndUnconfirmed(
    const std::vector<std::uint64_t>& episodes) {
  const MutexLock lock(mutex_);
  for (auto& [valve_id, valve] : valves_) {
    if (!valve.left || !valve.alarm ||
        std::ranges::find(episodes, EpisodeOf(*valve.alarm)) ==
            episodes.end()) {
      continue;
    }
    valve.alarm.reset();
    valve.left = false;
    if (valve.silent) {
      valve.state = State::kNormal;  // The last verdict was of the alarm.
    }
    Tell(valve_id, valve);
  }
}

void BusValveStates::OnVerdict(const std::string& valve_id,
                               const Sample& /*sample*/,
                               const ValveOutcome& outcome) {
  const Verdict& verdict = outcome.verdict;
  if (OutOfOrder(verdict.intake)) {
    return;
  }
  const bool alarm = verdict.detected && !outcome.notice;
  const bool partly = verdict.confidence < 1.0 || outcome.contested;
  const State state = outcome.notice ? State::kNormal : verdict.state;
  const MutexLock lock(mutex_);
  Valve& valve = valves_[valve_id];
  const bool news = valve.silent || valve.quality != verdict.quality ||
                    valve.state != state || valve.partly != partly ||
                    valve.models != outcome.models || outcome.model_swapped ||
                    valve.unjudged_ns != outcome.unjudged_ns ||
                    (valve.left && (alarm || outcome.found_normal));
  valve.silent = false;
  valve.quality = verdict.quality;
  valve.state = state;
  valve.partly = partly;
  valve.unjudged_ns = outcome.unjudged_ns;
  if (valve.unjudged_ns) {
    valve.why = WhyUnjudged(verdict.quality, verdict.intake, verdict.uncovered);
  }
  if (news) {
    valve.models = outcome.models;
    valve.model_set = outcome.models != nullptr ? NameOf(*outcome.models) : "";
  }
  valve.as_of_ns = verdict.stamp_ns;
  if (outcome.found_normal) {
    valve.normal_ns = verdict.stamp_ns;
    if (valve.left) {
      valve.alarm.reset();
    }
  }
  valve.left = valve.left && valve.alarm && !alarm;
  if (news || !IsFresh(valve.as_of_ns, valve.told.as_of_ns)) {
    Tell(valve_id, valve);
  }
}

void BusValveStates::OnSilence(const std::string& valve_id,
                               Silence /*silence*/) {
  const MutexLock lock(mutex_);
  Valve& valve = valves_[valve_id];
  valve.silent = true;
  valve.quality = Quality::kStale;
  Tell(valve_id, valve);
}

// An alarm outlasts the place of its valve.
void BusValveStates::OnRemoved(const std::string& valve_id,
                               Checkpoint& /*last*/) {
  const MutexLock lock(mutex_);
  Valve& valve = valves_[valve_id];
  if (!valve.alarm) {
    idl::ValveStateMessage gone;
    gone.valve_id = valve_id;
    publisher_.Unregister(gone);
    valves_.erase(valve_id);
  }
}

idl::ValveStateMessage BusValveStates::StateOf(const std::string& valve_id,
                                               const Valve& valve) const {
  idl::ValveStateMessage state;
  state.valve_id = valve_id;
  state.monitor = monitor_;
  state.as_of_ns = valve.as_of_ns;
  state.quality = valve.quality;
  state.partly = valve.partly;
  state.model_set = valve.model_set;
  // The event of what the verdict has found is on its way.
  state.state = valve.state;
  if (valve.alarm) {
    AddAlarm(*valve.alarm, state);
  }
  if (valve.alarm && valve.left) {
    state.unconfirmed_ns =
        valve.alarm->unconfirmed_ns.value_or(valve.alarm->last_ns);
  } else if (valve.silent) {
    state.unconfirmed_ns = valve.as_of_ns;
  }
  if (valve.unjudged_ns && !valve.silent) {
    state.unjudged_ns = *valve.unjudged_ns;
    state.why = valve.why;
  }
  return state;
}

void BusValveStates::Tell(const std::string& valve_id, Valve& valve) {
  idl::ValveStateMessage state = StateOf(valve_id, valve);
  idl::ValveStateMessage same = valve.told;
  same.as_of_ns = state.as_of_ns;
  if (state != same || !IsFresh(state.as_of_ns, valve.told.as_of_ns)) {
    publisher_.Write(state);
    valve.told = std::move(state);
  }
}

}  // namespace fdi::monitor
