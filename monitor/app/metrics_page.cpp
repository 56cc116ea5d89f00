#include "monitor/app/metrics_page.h"

#include <algorithm>
#include <chrono>

#include "monitor/app/process_facts.h"
#include "monitor/exposition.h"
#include "storage/data_directory.h"

namespace fdi::monitor {
namespace {

using Type = Exposition::Type;

void AddCounters(const Counters& counters, Exposition& page) {
  std::string_view family;
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const auto counter = static_cast<Counter>(i);
    const CounterMetric& metric = MetricOf(counter);
    if (metric.family != family) {
      family = metric.family;
      page.Family(family, Type::kCounter, metric.help);
    }
    page.Value(counters[counter], {metric.label, metric.value});
  }
  page.Family("fdi_samples_judged_total", Type::kCounter,
              "Samples by the verdict of the intake: accepted, or why not");
  for (int i = 0; i < kIntakeCount; ++i) {
    const auto intake = static_cast<Intake>(i);
    page.Value(counters[intake], {"verdict", IntakeName(intake)});
  }
  page.Family("fdi_sample_periods_total", Type::kCounter,
              "Sample periods by quality, with or without a sample");
  for (std::size_t i = 0; i < kQualityCount; ++i) {
    const auto quality = static_cast<Quality>(i);
    page.Value(counters[quality], {"quality", QualityLabel(quality)});
  }
}

void AddTransport(const idl::SubscriberStatus& samples,
                  const idl::PublisherStatus& decisions, Exposition& page) {
  page.Single("fdi_dds_samples_lost_total", Type::kCounter,
              "Samples written that will never come", samples.lost);
  page.Single("fdi_dds_samples_undecodable_total", Type::kCounter,
              "Samples with a value that no publisher of ours sends",
              samples.undecodable);
  page.Family("fdi_dds_samples_rejected_total", Type::kCounter,
              "Samples the reader refused: of valves beyond its limit, or sent "
              "again once there is room");
  page.Value(samples.rejected_instances, {"reason", "max_valves"});
  page.Value(samples.rejected_samples, {"reason", "full"});
  page.Single("fdi_dds_refused_valves", Type::kGauge,
              "Valves beyond the limit of the reader", samples.refused_valves);
  page.Single("fdi_dds_incompatible_total", Type::kCounter,
              "Publishers of samples whose QoS does not fit",
              samples.incompatible);
  page.Family("fdi_dds_publishers", Type::kGauge, "Publishers of samples now");
  page.Value(static_cast<std::uint64_t>(samples.matched), {"state", "matched"});
  page.Value(static_cast<std::uint64_t>(samples.alive), {"state", "alive"});
  page.Single("fdi_dds_decision_retries_total", Type::kCounter,
              "Times a slow subscriber made the diagnosis wait",
              decisions.retries);
  page.Single("fdi_dds_decision_subscribers", Type::kGauge,
              "Subscribers to decision vectors now",
              static_cast<std::uint64_t>(decisions.matched));
}

void AddValves(const ValveCensus& census, Exposition& page) {
  page.Single("fdi_valves", Type::kGauge, "Valves seen", census.valves);
  page.Family("fdi_valves_silent", Type::kGauge,
              "Valves without a sample for three periods, or whose publisher "
              "ended the stream");
  page.Value(census.stale, {"reason", "stale"});
  page.Value(census.ended, {"reason", "ended"});
  page.Single("fdi_valves_unassigned", Type::kGauge,
              "Valves without a model set", census.unassigned);
  page.Single("fdi_open_episodes", Type::kGauge, "Fault episodes now",
              census.open_episodes);
  page.Single("fdi_trace_bytes", Type::kGauge,
              "Memory of the evidence kept for valves", census.trace_bytes);
}

void AddStorage(const StatusFacts& status, const MetricsFacts& facts,
                Exposition& page) {
  page.Family("fdi_persistence_degraded", Type::kGauge,
              "1 while the database does not take what is to be stored");
  page.Value(std::uint64_t{status.history_degraded}, {"database", "history"});
  page.Value(std::uint64_t{status.recording_degraded}, {"database", "runs"});
  page.Family("fdi_database_bytes", Type::kGauge, "Size of the file");
  for (const DatabaseFacts& database : facts.databases) {
    page.Value(database.bytes, {"database", database.database});
  }
  page.Family("fdi_database_wal_bytes", Type::kGauge,
              "Size of the write-ahead log");
  for (const DatabaseFacts& database : facts.databases) {
    page.Value(database.wal_bytes, {"database", database.database});
  }
  page.Family("fdi_waiting", Type::kGauge,
              "Samples, records or points of evidence in a queue");
  page.Value(status.waiting.diagnosis, {"queue", "diagnosis"});
  page.Value(status.waiting.recorder, {"queue", "recorder"});
  page.Value(status.waiting.history.records, {"queue", "history"});
  page.Value(status.waiting.history.trace_points, {"queue", "evidence"});
}

void AddThreads(const std::vector<Heartbeat::Member>& threads,
                Exposition& page) {
  page.Family("fdi_thread_idle_seconds", Type::kGauge,
              "Time since the thread got on last");
  const auto now = Pulse::Clock::now();
  for (const Heartbeat::Member& member : threads) {
    const std::chrono::duration<double> idle = now - member.pulse->last();
    page.Value(std::max(idle.count(), 0.0), {"thread", member.thread});
  }
}

void AddConsole(const ConsoleLoad& console, Exposition& page) {
  page.Single("fdi_console_streams", Type::kGauge, "Live streams now",
              console.streams.clients);
  page.Family("fdi_console_streams_total", Type::kCounter,
              "Live streams that were begun, refused for want of a place, or "
              "dropped because the client did not keep up");
  page.Value(console.streams.admitted, {"outcome", "admitted"});
  page.Value(console.streams.refused, {"outcome", "refused"});
  page.Value(console.streams.dropped, {"outcome", "dropped"});
  page.Single("fdi_console_bytes", Type::kGauge,
              "Memory of the trends that the console shows",
              console.board_bytes);
}

void AddProcess(const MetricsFacts& facts, Exposition& page) {
  const ProcessFacts process = ReadProcessFacts();
  page.Family("fdi_build_info", Type::kGauge, "1; the label says which build");
  page.Value(std::uint64_t{1}, {"software", facts.software});
  page.Single("process_cpu_seconds_total", Type::kCounter,
              "User and system time", process.cpu_s);
  page.Single("process_resident_memory_bytes", Type::kGauge, "Memory in use",
              process.resident_bytes);
  page.Single("process_open_fds", Type::kGauge, "Open file descriptors",
              process.open_descriptors);
  page.Single("process_start_time_seconds", Type::kGauge,
              "Start in UTC since 1970",
              static_cast<double>(facts.started_ns) / 1e9);
}

}  // namespace

DatabaseFacts FactsOf(std::string_view database,
                      const std::filesystem::path& path) {
  return {database, storage::FileBytes(path), storage::WalBytes(path)};
}

std::string MetricsPage(const StatusFacts& status, const MetricsFacts& facts) {
  Exposition page;
  AddCounters(status.counters, page);
  AddTransport(status.samples, status.decisions, page);
  AddValves(status.census, page);
  AddStorage(status, facts, page);
  AddThreads(facts.threads, page);
  if (facts.console) {
    AddConsole(*facts.console, page);
  }
  AddProcess(facts, page);
  return page.text();
}

}  // namespace fdi::monitor
