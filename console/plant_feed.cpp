#include "console/plant_feed.h"

#include <algorithm>
#include <utility>

namespace fdi::console {
namespace {

constexpr std::chrono::seconds kMinPatience{3};
constexpr std::chrono::seconds kMonitorExpiry{60};
constexpr double kSilentPeriods = 3.0;

}  // namespace

std::shared_ptr<const ModelFacts> PlantFeed::Add(
    const idl::ModelSetInfoMessage& info) {
  ModelSet models;
  models.name = info.model_set;
  models.version = info.version;
  models.content_hash = info.model_hash;
  models.channels = info.channels;
  models.faults = info.faults;
  models.decision.isolation_threshold = info.isolation_threshold;
  models.decision.isolation_samples = info.isolation_samples;
  models.decision.detection_samples = info.detection_samples;
  models.sample_period_s = info.sample_period_s;
  models.flow_unit = info.flow_unit;
  // Several monitors may use the same set; sharing one object keeps trends
  // continuous.
  auto& facts = models_[info.model_hash];
  if (!facts) {
    facts = FactsOf(models);
  }
  return facts;
}

// Monitors are told apart by their participant, which every message has. The
// name of a monitor comes only with its status.
MonitorLine& PlantFeed::MarkAlive(const idl::Reception& reception,
                                  Clock::time_point now) {
  Monitor& monitor = monitors_[reception.participant_id];
  monitor.heard = now;
  monitor.line.heard_ns = reception.received_ns;
  return monitor.line;
}

void PlantFeed::Add(const idl::DecisionMessage& message,
                    const idl::Reception& reception, Clock::time_point now) {
  std::string monitor;
  {
    const MutexLock lock(mutex_);
    monitor = MarkAlive(reception, now).name;
  }
  const Verdict& verdict = message.verdict;
  Valve& valve = valves_[message.valve_id];
  const bool repeated =
      valve.source_id == verdict.source_id && verdict.seq <= valve.seq;
  valve.participant = reception.participant_id;
  if (repeated || OutOfOrder(verdict.intake)) {
    return;
  }
  const auto models = models_.find(message.model_hash);
  const auto facts = models == models_.end() ? nullptr : models->second;
  board_.ShowRemote(message.valve_id, verdict, facts, monitor);
  valve.source_id = verdict.source_id;
  valve.seq = verdict.seq;
  valve.heard = now;
  valve.silence = monitor::Silence::kNone;
  valve.patience = std::max<Clock::duration>(
      kMinPatience,
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(
          facts ? kSilentPeriods * facts->period_s : 0.0)));
}

void PlantFeed::Add(const idl::ValveStateMessage& state,
                    const idl::Reception& reception, Clock::time_point now) {
  {
    const MutexLock lock(mutex_);
    MarkAlive(reception, now);
  }
  if (!valves_.contains(state.valve_id)) {
    board_.Expect(state.valve_id, state.as_of_ns);
  }
  board_.ShowUnjudged(state.valve_id, state.unjudged_ns, state.why);
}

void PlantFeed::Add(const idl::MonitorStatusMessage& status,
                    const idl::Reception& reception, Clock::time_point now) {
  const MutexLock lock(mutex_);
  MonitorLine& line = MarkAlive(reception, now);
  line.name = status.monitor;
  line.software = status.software;
  line.health = idl::HealthName(status.health);
  line.text = status.text;
}

void PlantFeed::Poll(Clock::time_point now) {
  const MutexLock lock(mutex_);
  for (auto& [participant, monitor] : monitors_) {
    monitor.line.silent = now - monitor.heard > kMonitorSilence;
    monitor.line.valves = 0;
  }
  std::erase_if(valves_, [&](const auto& item) {
    const bool forget = now - item.second.heard > kForgetValve;
    if (forget) {
      Checkpoint none;
      board_.OnRemoved(item.first, none);
    }
    return forget;
  });
  for (auto& [id, valve] : valves_) {
    Monitor& monitor = monitors_[valve.participant];
    ++monitor.line.valves;
    UpdateSilence(id, valve, monitor, now);
  }
  std::erase_if(monitors_, [now](const auto& item) {
    return item.second.line.valves == 0 &&
           now - item.second.heard > kMonitorExpiry;
  });
}

void PlantFeed::UpdateSilence(const std::string& valve_id, Valve& valve,
                              const Monitor& monitor, Clock::time_point now) {
  const monitor::Silence silence =
      monitor.line.silent                  ? monitor::Silence::kMonitor
      : now - valve.heard > valve.patience ? monitor::Silence::kStale
                                           : monitor::Silence::kNone;
  if (silence == std::exchange(valve.silence, silence)) {
    return;
  }
  if (silence == monitor::Silence::kMonitor) {
    board_.ShowMonitorSilence(valve_id, monitor.line.heard_ns);
  } else {
    board_.OnSilence(valve_id, silence);
  }
}

std::vector<MonitorLine> PlantFeed::monitors() const {
  std::vector<MonitorLine> lines;
  const MutexLock lock(mutex_);
  for (const auto& [participant, monitor] : monitors_) {
    if (!monitor.line.name.empty()) {
      lines.push_back(monitor.line);
    }
  }
  std::ranges::sort(lines, {}, &MonitorLine::name);
  return lines;
}

}  // namespace fdi::console
