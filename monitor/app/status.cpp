#include "monitor/app/status.h"

#include <array>
#include <map>

#include <unistd.h>

namespace fdi::monitor {

std::string MonitorName() {
  std::array<char, 48> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) {
    host = {'?'};
  }
  return std::string(host.data()) + ":" + std::to_string(getpid());
}

idl::MonitorStatusMessage StatusOf(const StatusFacts& facts) {
  idl::MonitorStatusMessage status;
  status.counters = facts.counters.Snapshot();
  const auto add = [&status](const char* name, std::uint64_t value) {
    status.counters.emplace_back(name, value);
  };
  add("dds_lost", facts.samples.lost);
  add("dds_undecodable", facts.samples.undecodable);
  add("dds_rejected_instances", facts.samples.rejected_instances);
  add("dds_refused_valves", facts.samples.refused_valves);
  add("dds_rejected_samples", facts.samples.rejected_samples);
  add("dds_incompatible", facts.samples.incompatible);
  add("dds_decision_retries", facts.decisions.retries);
  add("dds_decision_readers",
      static_cast<std::uint64_t>(facts.decisions.matched));
  add("valves", facts.census.valves);
  add("valves_unassigned", facts.census.unassigned);
  add("valves_stale", facts.census.stale);
  add("valves_ended", facts.census.ended);
  add("open_episodes", facts.census.open_episodes);
  add("trace_bytes", facts.census.trace_bytes);
  add("waiting", facts.waiting.diagnosis);
  if (facts.history_degraded) {
    status.text = "persistence degraded: history";
  }
  if (facts.recording_degraded) {
    status.text +=
        status.text.empty() ? "persistence degraded: runs" : ", runs";
  }
  status.health =
      status.text.empty() ? idl::Health::kOk : idl::Health::kDegraded;
  if (!facts.stalled.empty()) {
    status.health = idl::Health::kFailing;
    status.text += (status.text.empty() ? "stalled: " : "; stalled: ") +
                   Joined(facts.stalled);
  }
  return status;
}

std::string ManagerLine(const idl::MonitorStatusMessage& status) {
  const std::map<std::string_view, std::uint64_t> counters(
      status.counters.begin(), status.counters.end());
  std::string line(idl::HealthName(status.health));
  for (const char* name : {"valves", "valves_stale", "open_episodes"}) {
    line += std::string(" ") + name + "=" + std::to_string(counters.at(name));
  }
  return status.text.empty() ? line : line + " (" + status.text + ")";
}

std::string Joined(const std::vector<std::string_view>& words) {
  std::string text;
  for (const std::string_view word : words) {
    text.append(text.empty() ? "" : ",").append(word);
  }
  return text;
}

std::string StatusLine(const idl::MonitorStatusMessage& status) {
  std::string line = "monitor_status health=";
  line += idl::HealthName(status.health);
  for (const auto& [name, value] : status.counters) {
    if (value != 0) {
      line += " " + name + "=" + std::to_string(value);
    }
  }
  return line;
}

}  // namespace fdi::monitor
