#include "monitor/service/status.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"

namespace fdi::monitor {
namespace {

using Type = Measure::Type;

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) +
         static_cast<double>(time.tv_usec) * 1e-6;
}

// User and system time of this process; 0 where the kernel does not tell, as in
// the functions below.
double CpuSeconds() {
  rusage usage{};
  return getrusage(RUSAGE_SELF, &usage) == 0
             ? Seconds(usage.ru_utime) + Seconds(usage.ru_stime)
             : 0.0;
}

std::uint64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");  // In pages: total, resident, ...
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  file >> total >> resident;
  return resident * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
}

std::uint64_t OpenDescriptors() {
  std::error_code error;
  const std::filesystem::directory_iterator open("/proc/self/fd", error);
  return error ? 0
               : static_cast<std::uint64_t>(
                     std::distance(begin(open), end(open)));
}

void AddDatabases(const storage::DataDirectory& data, Exposition& page) {
  const std::array<std::pair<std::string_view, std::filesystem::path>, 3>
      databases{{{"history", data.history()},
                 {"models", data.models()},
                 {"runs", data.runs()}}};
  page.Family("fdi_database_bytes", Type::kGauge, "Size of the file");
  for (const auto& [name, path] : databases) {
    page.Value(std::uint64_t{storage::FileBytes(path)}, {"database", name});
  }
  page.Family("fdi_database_wal_bytes", Type::kGauge,
              "Size of the write-ahead log");
  for (const auto& [name, path] : databases) {
    page.Value(std::uint64_t{storage::WalBytes(path)}, {"database", name});
  }
}

void AddThreads(const std::vector<Heartbeat::Member>& threads,
                Exposition& page) {
  page.Family("fdi_thread_idle_seconds", Type::kGauge,
              "Time since the thread last made progress");
  const auto now = Pulse::Clock::now();
  for (const Heartbeat::Member& member : threads) {
    const std::chrono::duration<double> idle = now - member.pulse->last();
    page.Value(std::max(idle.count(), 0.0), {"thread", member.thread});
  }
}

void AddAlarms(const storage::AlarmCounts& counts, Exposition& page) {
  const auto add = [&page](const auto& by_severity) {
    for (std::size_t i = 0; i < by_severity.size(); ++i) {
      page.Value(by_severity[i],
                 {"priority", SeverityName(static_cast<Severity>(i))});
    }
  };
  page.Family("fdi_alarms_active", Type::kGauge,
              "Alarms that are active and not shelved");
  add(counts.active);
  page.Family("fdi_alarms_unacknowledged", Type::kGauge,
              "Alarms that nobody has acknowledged, active or returned to "
              "normal, and that are not shelved");
  add(counts.unacked);
}

void AddProcess(const MetricsFacts& facts, Exposition& page) {
  page.Add({{"", "fdi_build_info", Type::kGauge,
             "1; the label says which build", "software", facts.software, 1},
            {"", "process_resident_memory_bytes", Type::kGauge, "Memory in use",
             "", "", ResidentBytes()},
            {"", "process_open_fds", Type::kGauge, "Open file descriptors", "",
             "", OpenDescriptors()}});
  page.Family("process_cpu_seconds_total", Type::kCounter,
              "User and system time");
  page.Value(CpuSeconds());
  page.Family("process_start_time_seconds", Type::kGauge,
              "Start in UTC since 1970");
  page.Value(static_cast<double>(facts.started_ns) / 1e9);
}

HttpPage Answer(bool good, const nlohmann::ordered_json& body) {
  return {good ? 200 : 503, "application/json", body.dump() + "\n"};
}

HttpPage HealthPage(const Heartbeat& heartbeat) {
  const auto stalled =
      heartbeat.StalledSince(Pulse::Clock::now() - kStallLimit);
  return Answer(stalled.empty(),
                {{"healthy", stalled.empty()}, {"stalled", stalled}});
}

HttpPage ReadinessPage(const Readiness& readiness) {
  return Answer(readiness.ready(), {{"ready", readiness.ready()},
                                    {"model_sets", readiness.model_sets},
                                    {"databases", readiness.databases},
                                    {"publishers", readiness.publishers}});
}

// Refusals on the network, and from how many participants.
void AddRefusals(const StatusFacts& facts, std::vector<Measure>& measures) {
  constexpr Type kCounter = Type::kCounter;
  std::uint64_t refused_datagrams = 0;
  for (std::size_t i = 0; i < idl::kDatagramVerdictCount; ++i) {
    const auto verdict = static_cast<idl::DatagramVerdict>(i);
    // Verdict 0 is kSound; all others are refusals.
    refused_datagrams += i == 0 ? 0 : facts.datagrams[i];
    measures.push_back({"", "fdi_dds_datagrams_total", kCounter,
                        "Datagrams by the check of their framing: sound, or "
                        "why they were dropped",
                        "verdict",
                        std::string(idl::DatagramVerdictName(verdict)),
                        facts.datagrams[i]});
  }
  measures.push_back(
      {"dds_refused_datagrams", "", kCounter, "", "", "", refused_datagrams});
  measures.push_back({"dds_refused_participants",
                      "fdi_dds_participants_refused_total", kCounter,
                      "Participants without a key of our authority", "", "",
                      facts.refused_participants});
  measures.push_back({"", "fdi_dds_permissions_refused_total", kCounter,
                      "Participants, writers and readers with a key of our "
                      "authority without the right to what they do",
                      "", "", facts.refused_permissions});
}

}  // namespace

// The status on the bus has room for idl::kMaxCounters = 64 names and uses all
// of them, so what is added here gets a family and no name. Values of one
// family are adjacent, and the page shows the help of the first.
// NOLINTNEXTLINE(readability-function-size): a table.
std::vector<Measure> MeasuresOf(const StatusFacts& facts) {
  constexpr Type kCounter = Type::kCounter;
  constexpr Type kGauge = Type::kGauge;
  const idl::SubscriberStatus& samples = facts.samples;
  const idl::PublisherStatus& decisions = facts.decisions;
  const ValveCensus& census = facts.census;
  const auto number = [](int n) { return static_cast<std::uint64_t>(n); };
  constexpr std::string_view kRejected = "fdi_dds_samples_rejected_total";
  constexpr std::string_view kRejectedHelp =
      "Samples the reader refused: of valves beyond its limit, or sent again "
      "once there is room";
  constexpr std::string_view kSilentHelp =
      "Valves without a sample for three periods, or whose publisher ended the "
      "stream";
  constexpr std::string_view kDegradedHelp =
      "1 while the database does not take what is to be stored";
  constexpr std::string_view kWaitingHelp =
      "Samples, records or points of evidence in a queue";
  std::vector<Measure> measures = facts.counters.Measures();
  AddRefusals(facts, measures);
  const std::vector<Measure> others{
      {"dds_lost", "fdi_dds_samples_lost_total", kCounter,
       "Samples that were published but will never arrive", "", "",
       samples.lost},
      {"dds_undecodable", "fdi_dds_samples_undecodable_total", kCounter,
       "Samples with a value that no publisher of this project sends", "", "",
       samples.undecodable},
      {"dds_rejected_instances", kRejected, kCounter, kRejectedHelp, "reason",
       "max_valves", samples.rejected_instances},
      {"dds_rejected_samples", kRejected, kCounter, kRejectedHelp, "reason",
       "full", samples.rejected_samples},
      {"dds_refused_valves", "fdi_dds_refused_valves", kGauge,
       "Valves beyond the limit of the reader", "", "", samples.refused_valves},
      {"dds_incompatible", "fdi_dds_incompatible_total", kCounter,
       "Publishers of samples whose QoS does not fit", "", "",
       samples.incompatible},
      {"", "fdi_dds_publishers", kGauge, "Publishers of samples now", "state",
       "matched", number(samples.matched)},
      {"", "fdi_dds_publishers", kGauge, "", "state", "alive",
       number(samples.alive)},
      {"dds_decision_retries", "fdi_dds_decision_retries_total", kCounter,
       "Times a slow subscriber made the diagnosis wait", "", "",
       decisions.retries},
      {"dds_decision_readers", "fdi_dds_decision_subscribers", kGauge,
       "Subscribers to decision vectors now", "", "",
       number(decisions.matched)},
      {"valves", "fdi_valves", kGauge, "Valves seen", "", "", census.valves},
      {"valves_unassigned", "fdi_valves_unassigned", kGauge,
       "Valves without a model set", "", "", census.unassigned},
      {"valves_stale", "fdi_valves_silent", kGauge, kSilentHelp, "reason",
       "stale", census.stale},
      {"valves_ended", "fdi_valves_silent", kGauge, kSilentHelp, "reason",
       "ended", census.ended},
      {"valves_contested", "fdi_valves_contested", kGauge,
       "Valves that another monitor takes, too, or that two publishers send",
       "by", "monitor", facts.contested.count},
      {"valves_two_publishers", "fdi_valves_contested", kGauge, "", "by",
       "publisher", census.contested},
      {"", "fdi_valves_unjudged", kGauge,
       "Valves that send in AUTO and are not judged for ten minutes or more",
       "", "", census.unjudged},
      {"open_episodes", "fdi_open_episodes", kGauge, "Fault episodes now", "",
       "", census.open_episodes},
      {"trace_bytes", "fdi_trace_bytes", kGauge,
       "Memory of the evidence kept for valves", "", "", census.trace_bytes},
      {"", "fdi_persistence_degraded", kGauge, kDegradedHelp, "database",
       "history", std::uint64_t{facts.history_degraded}},
      {"", "fdi_persistence_degraded", kGauge, kDegradedHelp, "database",
       "runs", std::uint64_t{facts.recording_degraded}},
      {"waiting", "fdi_waiting", kGauge, kWaitingHelp, "queue", "diagnosis",
       samples.waiting},
      {"", "fdi_waiting", kGauge, kWaitingHelp, "queue", "recorder",
       facts.recorder_backlog},
      {"", "fdi_waiting", kGauge, kWaitingHelp, "queue", "history",
       facts.journal.records},
      {"", "fdi_waiting", kGauge, kWaitingHelp, "queue", "evidence",
       facts.journal.trace_points}};
  measures.insert(measures.end(), others.begin(), others.end());
  return measures;
}

idl::MonitorStatusMessage StatusOf(const StatusFacts& facts) {
  idl::MonitorStatusMessage status;
  for (Measure& measure : MeasuresOf(facts)) {
    if (!measure.name.empty()) {
      status.counters.emplace_back(std::move(measure.name), measure.value);
    }
  }
  if (facts.history_degraded) {
    status.text = "persistence degraded: history";
  }
  if (facts.recording_degraded) {
    status.text +=
        status.text.empty() ? "persistence degraded: runs" : ", runs";
  }
  if (facts.contested.count > 0) {
    status.text += status.text.empty() ? "" : "; ";
    status.text +=
        Printable(facts.contested.monitor) + " takes " +
        std::to_string(facts.contested.count) +
        " of these valves, too: " + Printable(facts.contested.example);
  }
  if (facts.census.contested > 0) {
    status.text += (status.text.empty() ? "two publishers send "
                                        : "; two publishers send ") +
                   Printable(facts.census.contested_valve);
    if (facts.census.contested > 1) {
      status.text +=
          " and " + std::to_string(facts.census.contested - 1) + " more valves";
    }
  }
  // A plant always has a few valves outside of what they were taught.
  if (10 * facts.census.unjudged > facts.census.valves) {
    status.text += status.text.empty() ? "" : "; ";
    status.text += "not judged: " + std::to_string(facts.census.unjudged) +
                   " of " + std::to_string(facts.census.valves) +
                   " valves, for longest " +
                   Printable(facts.census.unjudged_valve) + " since " +
                   FormatTime(facts.census.unjudged_ns, true) + " (" +
                   facts.census.unjudged_reason + ")";
  }
  status.health =
      status.text.empty() ? idl::Health::kOk : idl::Health::kDegraded;
  // Last, because FAILING outranks DEGRADED, whose reasons are kept in the
  // text.
  if (!facts.stalled.empty()) {
    status.health = idl::Health::kFailing;
    status.text += (status.text.empty() ? "stalled: " : "; stalled: ") +
                   JoinText(facts.stalled, ",");
  }
  // The names of other monitors and of valves may be long.
  if (status.text.size() > idl::kMaxTextLength) {
    std::size_t end = idl::kMaxTextLength;
    while (end > 0 && (status.text[end] & 0xC0) == 0x80) {
      --end;  // Within a character of UTF-8.
    }
    status.text.resize(end);
  }
  return status;
}

std::string NewMonitorName() {
  // 47 bytes of the host, a colon, the pid and the suffix fit the 64 bytes that
  // the wire has for the name of a monitor. gethostname() need not terminate a
  // name that it cuts: the last byte, which it is not given, remains 0.
  std::array<char, 48> host{};
  if (gethostname(host.data(), host.size() - 1) != 0) {
    host = {'?'};
  }
  std::string name = std::string(host.data()) + ":" + std::to_string(getpid());
  // In containers every monitor may be HOST:1.
  constexpr ino_t kFirstPidNamespace = 0xEFFFFFFC;  // Linux, proc_ns.h
  struct stat pids {};
  if (stat("/proc/self/ns/pid", &pids) != 0 ||
      pids.st_ino != kFirstPidNamespace) {
    std::array<char, 8> suffix{};
    std::snprintf(suffix.data(), suffix.size(), "-%06x",
                  std::random_device()() & 0xFFFFFFU);
    name += suffix.data();
  }
  return name;
}

std::string MonitorName() {
  static const std::string name = NewMonitorName();
  return name;
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

std::string MetricsPage(const StatusFacts& status, const MetricsFacts& facts) {
  Exposition page;
  page.Add(MeasuresOf(status));
  AddDatabases(facts.data, page);
  AddThreads(facts.threads, page);
  if (facts.alarms) {
    AddAlarms(*facts.alarms, page);
  }
  AddProcess(facts, page);
  return page.text();
}

HttpServer::Pages ProbePages(const Heartbeat& heartbeat, ProbeSources sources) {
  return {{"/metrics",
           [metrics = std::move(sources.metrics)] {
             return HttpPage{200, "text/plain; version=0.0.4; charset=utf-8",
                             metrics()};
           }},
          {"/healthz", [&heartbeat] { return HealthPage(heartbeat); }},
          {"/readyz", [readiness = std::move(sources.readiness)] {
             return ReadinessPage(readiness());
           }}};
}

}  // namespace fdi::monitor
