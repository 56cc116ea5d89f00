// How the service is: on the bus, over HTTP, in the log, to its manager.
#include "monitor/app/probes.h"
#include "monitor/app/service.h"
#include "monitor/app/shadow.h"
#include "monitor/app/status.h"
#include "storage/cli/time_text.h"

namespace fdi::monitor {

void Service::ServeProbes() {
  http_->Add(ProbePages(heartbeat_, {[this] { return Metrics(); },
                                     [this] { return CurrentReadiness(); }}));
  http_->Start();
  context_.log(LogLevel::kInfo,
               "http_listening address=" + ToString(http_->address()));
}

void Service::ServeConsole() {
  const auto facts = [this] {
    const idl::MonitorStatusMessage status = StatusOf(Facts());
    return console::MonitorFacts{idl::HealthName(status.health),
                                 status.counters,
                                 pipeline_.census().open_episodes};
  };
  console_->Start({data_.history(), data_.models(), context_.software,
                   started_ns_, facts, cli::NowNs});
}

Readiness Service::CurrentReadiness() const {
  return {model_sets_,
          !pipeline_.history_degraded() && !pipeline_.recording_degraded(),
          samples_.status().matched};
}

std::string Service::Metrics() const {
  MetricsFacts facts{
      context_.software,
      started_ns_,
      {FactsOf("history", data_.history()), FactsOf("models", data_.models()),
       FactsOf("runs", data_.runs())},
      heartbeat_.members(),
      std::nullopt};
  if (console_) {
    facts.console = {console_->streams(), console_->board_bytes()};
  }
  std::string page = MetricsPage(Facts(), facts);
  if (const ShadowCounts* counts = pipeline_.shadow_counts()) {
    page += ShadowMetrics(*counts);
  }
  return page;
}

StatusFacts Service::Facts() const {
  return {counters_,
          pipeline_.census(),
          samples_.status(),
          decisions_.status(),
          pipeline_.backlog(),
          pipeline_.history_degraded(),
          pipeline_.recording_degraded(),
          heartbeat_.StalledSince(Pulse::Clock::now() - kStallLimit)};
}

void Service::ReportLoss() {
  const idl::SubscriberStatus dds = samples_.status();
  const std::uint64_t loss =
      dds.lost + dds.undecodable + dds.rejected_instances;
  if (loss != reported_loss_) {
    reported_loss_ = loss;
    log_.Report(LogId::kTransport, "transport_loss", [&dds] {
      return "lost=" + std::to_string(dds.lost) +
             " undecodable=" + std::to_string(dds.undecodable) +
             " rejected_instances=" + std::to_string(dds.rejected_instances) +
             " refused_valves=" + std::to_string(dds.refused_valves);
    });
  }
}

void Service::ReportStall() {
  const auto stalled =
      heartbeat_.StalledSince(std::chrono::steady_clock::now() - kStallLimit);
  if (!stalled.empty()) {
    log_.Report(
        LogId::kStalled, "threads_stalled",
        [&stalled] { return "threads=" + Joined(stalled); }, LogLevel::kError);
  }
}

void Service::PublishStatus() {
  idl::MonitorStatusMessage status = StatusOf(Facts());
  status.monitor = MonitorName();
  status.software = context_.software;
  status.started_ns = started_ns_;
  status.stamp_ns = cli::NowNs();
  status_topic_.Write(status);
  manager_.Status(ManagerLine(status));
}

void Service::WriteStatusLine() {
  context_.log(LogLevel::kInfo, StatusLine(StatusOf(Facts())));
}

}  // namespace fdi::monitor
