#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/worker.h"
#include "idl/endpoint.h"
#include "monitor/after_commit.h"
#include "monitor/bus/bus_sinks.h"
#include "monitor/bus/bus_valve_states.h"
#include "monitor/bus/share_watch.h"
#include "monitor/heartbeat.h"
#include "monitor/http/http_server.h"
#include "monitor/pipeline.h"
#include "monitor/recorder.h"
#include "monitor/service/event_hook.h"
#include "monitor/service/history_store.h"
#include "monitor/service/model_assignment.h"
#include "monitor/service/run_store.h"
#include "monitor/service/service_part.h"
#include "monitor/service/status.h"
#include "report/program.h"
#include "report/stop_signals.h"
#include "storage/database/data_directory.h"
#include "storage/database/locks.h"
#include "storage/history/history_reader.h"

namespace fdi::monitor {

enum class Recording : std::uint8_t { kOff, kOn, kLossless };

/// Settings of `fdi-monitor run`.
struct ServiceOptions {
  PipelineOptions pipeline;
  std::optional<storage::ModelReference> model_set;
  Recording recording{Recording::kOff};
  bool lossless_decisions{false};
  bool best_effort{false};       ///< ValveSample without retransmission.
  double status_period_s{60.0};  ///< Of the status line in the log.
  /// Serve metrics and probes over HTTP.
  std::optional<HttpAddress> http;
  /// Notify a program or a web server of events; empty: disabled.
  std::string on_event;
  int on_event_per_minute{60};
  double on_event_timeout_s{10.0};
  /// Called once, before the service manager is told that it is ready.
  std::function<void()> on_ready{[] {}};
  /// Optional parts, which follow valves and events in this order.
  std::vector<std::shared_ptr<ServicePart>> parts{};
  /// The false alarms of all valves, ParseAlarmBudget(); "off": every episode
  /// is an alarm.
  std::string alarm_budget{"1/week"};
};

/// Tells the service manager (systemd, Type=notify), if there is one.
void NotifyManager(const std::string& state);

/// The monitor as a service: DDS on one side, the databases on the other, the
/// pipeline between them. The thread of Run() handles signals, status, watchdog
/// and new models. Runs once.
class Service {
 public:
  /// Opens all resources and starts none of its threads.
  /// @throws ConfigError, DataError, NotFoundError, idl::TransportError,
  ///   storage::SqliteError
  Service(const ServiceOptions& options, const report::Context& context);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// Serves until a signal requests a stop, a thread fails or an interface is
  /// gone, then stores and publishes what was received and ends all threads in
  /// any case.
  /// @returns the exit code. @throws the first error.
  int Run(report::StopSignals& signals);

 private:
  using TimePoint = Heartbeat::TimePoint;

  PipelineOptions WithDelivery(PipelineOptions options);
  void AttachListeners();
  void ListAfterCommit();
  std::vector<storage::Shelf> ShelvesInForce();
  ValveIdentity IdentityOf(const std::string& valve_id);
  void AnnounceModels(const ModelSet& models);

  void Start();
  void ResendEvents();
  void RecoverAlarms();
  void EndAcknowledgedAlarms();
  void RefreshBudget();
  void StartParts();
  void TellAssignedValves();
  void ServeProbes();
  void Diagnose();

  void Serve(report::StopSignals& signals);
  void Tick();
  void Reload(const char* cause);
  std::shared_ptr<const ModelAssignment> ReadModels(
      ModelAssignment::Announce announce) const;
  void LoadModels();
  TimePoint FeedWatchdog(TimePoint next_tick);

  bool Failed() const;
  bool RecordingDegraded() const;
  StatusFacts Facts() const;
  std::string Metrics() const;
  void ReportLoss();
  void ReportStall();
  void PublishStatus();

  void Stop();
  void StopDiagnosis();

  ServiceOptions options_;
  const report::Context& context_;
  std::unique_ptr<HttpServer> http_;  // Null: no probes.
  storage::DataDirectory data_;
  storage::ExclusiveLock lock_;
  std::unique_ptr<EventHook> hook_;  // Null: no event hook.
  // For the step "on_event", one event at a time; null: not open.
  std::unique_ptr<storage::HistoryReader> shelf_reader_;
  std::unique_ptr<storage::ModelStore> identity_reader_;
  // The thread of Run() alone uses it; null: not open.
  std::unique_ptr<storage::HistoryReader> alarm_reader_;
  idl::Participant participant_;
  idl::Participant intake_participant_;  // See idl::Overflow.
  idl::Publisher<idl::ModelSetInfoMessage> models_topic_;
  storage::ChangeCounter changes_;
  std::shared_ptr<const ModelAssignment> assignment_;
  std::atomic<std::size_t> model_sets_;
  const double between_alarms_h_;  // 0: no budget.
  const std::shared_ptr<AlarmGate> gate_;
  HistoryStore history_;
  std::unique_ptr<RunStore> runs_;     // Null: nothing is recorded.
  std::stop_source publication_stop_;  // Ends waits for slow subscribers.
  BusDecisionSink decisions_;
  BusEventSink events_;
  BusValveStates states_;
  idl::Publisher<idl::MonitorStatusMessage> status_topic_;
  idl::Subscriber<idl::ValveSampleMessage> samples_;
  Counters counters_;
  ThrottledLog log_;
  AfterCommit after_commit_;
  ShareWatch shares_;
  std::unique_ptr<Recorder> recorder_;  // Set together with runs_.
  Pipeline pipeline_;
  Pulse service_pulse_;  // Beaten by the thread of Run().
  Heartbeat heartbeat_;
  std::optional<Watchdog> watchdog_;  // Only if a service manager asks for it.
  std::string notified_status_;
  std::int64_t started_ns_;
  std::uint64_t reported_loss_{0};
  TimePoint last_status_line_;
  TimePoint next_budget_{};
  std::optional<TimePoint> retry_reload_at_;   // After a reload that failed,
  std::chrono::milliseconds reload_pause_{0};  // this long after the last try.
  std::atomic<bool> stopping_{false};
  std::atomic<TimePoint> drain_until_{TimePoint{}};
  Worker diagnosis_;
};

}  // namespace fdi::monitor
