// The service from start to end. Orders that matter:
//
// Start: what an earlier session left unsent is published before the journal's
// threads use the same connection. The subscription is served last, once all
// consumers are ready; until then samples queue at the subscriber.
//
// Stop: HTTP stops accepting requests, the diagnosis drains the subscriber,
// recorder and journal store and publish the results, the parts read the last
// events, the hook gets a second for its deliveries, the
// session is closed in the history, and the last status is published. Each step
// is attempted even if an earlier one failed.
#include "monitor/service/service.h"

#include <algorithm>
#include <exception>
#include <functional>
#include <limits>
#include <utility>

#include <systemd/sd-daemon.h>

#include "base/printable.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "diagnosis/loop/loop_watch.h"
#include "diagnosis/records/partitions.h"
#include "diagnosis/records/valve_glob.h"
#include "idl/library_log.h"
#include "monitor/bus/dds_options.h"
#include "monitor/clock_watch.h"
#include "monitor/guard.h"
#include "monitor/health_book.h"
#include "report/fault_texts.h"
#include "report/findings/finding.h"
#include "report/logging.h"
#include "report/text_table.h"
#include "storage/history/healthy_hours.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

// Without samples, Pipeline::Poll() runs as often as this.
constexpr milliseconds kTakeTimeout{100};
constexpr int kTakeLimit = 4096;  // Bounds a call of Take() under full load.
constexpr milliseconds kTickPeriod{1000};
// After a reload that failed; doubled each time, as all sets are read again.
constexpr milliseconds kReloadPause{2000};
constexpr milliseconds kMaxReloadPause{300'000};
// Return periods are told from hours.
constexpr std::chrono::hours kBudgetPeriod{1};
// Each of these bounds one step of a stop. SIGTERM ends the monitor within 5 s,
// also with a subscriber that does not read (docs/operations.md).
constexpr milliseconds kHookPatience{1000};
constexpr milliseconds kDrainLimit{1000};
constexpr milliseconds kSubscriberPatience{1000};
constexpr milliseconds kAcknowledgeLimit{300};

milliseconds Milliseconds(double seconds) {
  return milliseconds(static_cast<std::int64_t>(seconds * 1e3));
}

// A folder that was not there may be one that was not meant.
storage::DataDirectory Prepared(const std::filesystem::path& path,
                                const LogSink& log) {
  storage::DataDirectory data{path};
  const bool is_new = !std::filesystem::exists(path);
  storage::EnsureExists(data);
  if (is_new) {
    log(LogLevel::kWarning,
        EventLine("data_folder_made",
                  {{"path", std::filesystem::absolute(path).string()}}));
  }
  PrepareModels(data.models());
  return data;
}

std::vector<Heartbeat::Member> Members(const Pipeline& pipeline,
                                       const Recorder* recorder,
                                       const Pulse& service) {
  std::vector<Heartbeat::Member> members = pipeline.threads();
  if (recorder != nullptr) {
    members.push_back({"recorder", &recorder->pulse()});
  }
  members.push_back({"service", &service});
  return members;
}

// The reader never frees the slot of a valve while its publisher is alive, so
// it needs more slots than the pipeline, which does free them.
int IntakeValves(int max_valves) {
  constexpr int kSpareSlots = 60'000;
  constexpr int kMaxSlots = 100'000;  // See idl::DdsOptions.
  return std::min(max_valves + kSpareSlots, kMaxSlots);
}

std::string MonotonicMicroseconds() {
  return std::to_string(std::chrono::duration_cast<std::chrono::microseconds>(
                            Clock::now().time_since_epoch())
                            .count());
}

}  // namespace

void NotifyManager(const std::string& state) {
  sd_notify(0, state.c_str());
}

// Members are initialised in the order in which they use each other. The
// session in the history begins only in Start(), so that an error in options or
// files leaves no trace.
Service::Service(const ServiceOptions& options, const report::Context& context)
    : options_(options),
      context_(context),
      http_(options.http
                ? std::make_unique<HttpServer>(HttpServerOptions{*options.http})
                : nullptr),
      data_(Prepared(context.options.data_dir, context.log)),
      lock_(data_.lock(), "recording faults"),
      hook_(
          options.on_event.empty()
              ? nullptr
              : std::make_unique<EventHook>(
                    MakeEventDelivery(options.on_event,
                                      Milliseconds(options.on_event_timeout_s)),
                    EventHookOptions{.per_minute = options.on_event_per_minute},
                    context.log)),
      participant_(DdsOptionsOf(context.options, options.pipeline.max_valves),
                   context.log, "fdi-monitor"),
      intake_participant_(
          DdsOptionsOf(context.options,
                       IntakeValves(options.pipeline.max_valves)),
          context.log, "fdi-monitor intake"),
      models_topic_(participant_),
      changes_(data_.models()),
      assignment_(std::make_shared<const ModelAssignment>(
          data_.models(), options.model_set,
          [this](const ModelSet& models) { AnnounceModels(models); })),
      model_sets_(assignment_->loaded()),
      between_alarms_h_(options.alarm_budget == "off"
                            ? 0.0
                            : ParseAlarmBudget(options.alarm_budget)),
      gate_(std::make_shared<AlarmGate>()),
      history_(data_.history(), NowNs, context.log),
      runs_(options.recording == Recording::kOff
                ? nullptr
                : std::make_unique<RunStore>(data_.runs(), context.software)),
      decisions_(participant_,
                 options.lossless_decisions ? MonitorName() : std::string(),
                 publication_stop_.get_token()),
      events_(participant_, context.log),
      states_(participant_, MonitorName(),
              report::LoadFaultTexts(context.options)),
      status_topic_(participant_),
      samples_(
          intake_participant_,
          options.best_effort ? idl::Profile::kBestEffort : idl::Profile::kLive,
          idl::Overflow::kOnTheWay,
          ParsePartitions(context.options.partition, true)),
      log_(context.log),
      after_commit_(counters_, log_),
      shares_(participant_,
              {MonitorName(), options.pipeline.valve_glob,
               context.options.partition},
              log_),
      recorder_(runs_ ? std::make_unique<Recorder>(
                            *runs_, MonitorContext{counters_, log_, NowNs},
                            RecorderOptions{.lossless = options.recording ==
                                                        Recording::kLossless},
                            [this](DataGap gap) {
                              pipeline_.ReportGap(std::move(gap));
                            })
                      : nullptr),
      pipeline_(WithDelivery(options.pipeline),
                {decisions_, after_commit_, history_}, assignment_,
                {counters_, log_, NowNs}),
      heartbeat_(Members(pipeline_, recorder_.get(), service_pulse_)),
      started_ns_(NowNs()),
      last_status_line_(Clock::now()) {
  // Decision vectors of loops without a model set refer to it; it is in no
  // store.
  models_topic_.Write(idl::Describe(*AuditModels(LoopWatch::kInterval_s)));
  AttachListeners();
  ListAfterCommit();
}

Service::~Service() = default;

// Who follows the valves, in this order.
void Service::AttachListeners() {
  pipeline_.Attach(states_);
  pipeline_.Attach(std::make_unique<HealthBooks>(counters_));
  pipeline_.Attach(std::make_unique<ClockWatch>(NowNs, context_.log));
  for (const auto& part : options_.parts) {
    if (ValveListener* const listener = part->listener()) {
      pipeline_.Attach(*listener);
    }
  }
  if (recorder_) {
    pipeline_.Attach(*recorder_);  // Last: it may wait for the disk.
  }
}

// The steps that an event takes, in this order.
void Service::ListAfterCommit() {
  for (const auto& part : options_.parts) {
    after_commit_.Add(std::string(part->name()),
                      [part](const FaultEvent& event, bool stored) {
                        part->OnCommitted(event, stored);
                      });
  }
  after_commit_.Add("states", [this](const FaultEvent& event, bool /*stored*/) {
    states_.OnEvent(event);
  });
  after_commit_.Add(events_);
  if (hook_) {
    after_commit_.Add(
        "on_event", [this, texts = report::LoadFaultTexts(context_.options)](
                        const FaultEvent& event, bool stored) {
          // Its session may have notified of it.
          if (!event.resent && !event.transition.notice) {
            hook_->Notify(EventJson(event, stored, texts, ShelvesInForce(),
                                    IdentityOf(event.valve_id)));
          }
        });
  }
}

// Nothing where it cannot be read: an alarm without it is better than none.
ValveIdentity Service::IdentityOf(const std::string& valve_id) {
  try {
    if (!identity_reader_) {
      identity_reader_ = std::make_unique<storage::ModelStore>(data_.models());
    }
    identity_reader_->database().Refresh();
    const auto loop = storage::FindLoop(*identity_reader_, valve_id);
    return loop ? static_cast<const ValveIdentity&>(*loop) : ValveIdentity{};
  } catch (const std::exception&) {
    identity_reader_.reset();
    return {};
  }
}

// None where they cannot be read: an alarm too many is better than none.
std::vector<storage::Shelf> Service::ShelvesInForce() {
  try {
    if (!shelf_reader_) {
      shelf_reader_ = std::make_unique<storage::HistoryReader>(data_.history());
    }
    shelf_reader_->database().Refresh();
    const std::int64_t now_ns = NowNs();
    auto shelves = shelf_reader_->Shelves(now_ns);
    std::erase_if(shelves,
                  [now_ns](const auto& s) { return !IsActive(s, now_ns); });
    return shelves;
  } catch (const std::exception&) {
    shelf_reader_.reset();
    return {};
  }
}

PipelineOptions Service::WithDelivery(PipelineOptions options) {
  options.severities = std::make_shared<const SeverityCatalogue>(
      report::LoadFaultTexts(context_.options).Severities());
  options.alarms = gate_;
  options.journal.acknowledged = [this](milliseconds patience) {
    return events_.WaitForAcknowledged(patience);
  };
  return options;
}

// Called by any thread that resolves models.
void Service::AnnounceModels(const ModelSet& models) {
  models_topic_.Write(idl::Describe(models));
  context_.log(LogLevel::kInfo, "models_loaded model_set=" + NameOf(models));
}

int Service::Run(report::StopSignals& signals) {
  FirstError errors;
  errors.Try([&] {
    Start();
    Serve(signals);
  });
  errors.Try([this] { Stop(); });
  errors.Rethrow();
  const bool incomplete = pipeline_.history_degraded() || RecordingDegraded();
  return incomplete ? report::kExitData : report::kExitOk;
}

bool Service::Failed() const {
  return pipeline_.failed() || diagnosis_.failed() ||
         (recorder_ && recorder_->failed());
}

bool Service::RecordingDegraded() const {
  return recorder_ && recorder_->degraded();
}

void Service::Start() {
  history_.BeginSession(context_.software, context_.command_line,
                        report::LoadFaultTexts(context_.options).Names());
  if (hook_) {
    hook_->Start();
  }
  StartParts();
  ResendEvents();
  RecoverAlarms();
  Guarded(counters_, log_, "alarm_budget", [this] { RefreshBudget(); });
  if (recorder_) {
    recorder_->Start();
  }
  pipeline_.Start(history_.OpenEpisodes(), history_.Accumulators());
  diagnosis_.Start([this] { Diagnose(); });
  if (http_) {
    ServeProbes();
  }
}

// Publishes what an earlier session committed but may not have sent.
void Service::ResendEvents() {
  for (const FaultEvent& event : history_.UnsentEvents()) {
    const bool sent = after_commit_.Publish(event, true);
    counters_.Add(sent ? Counter::kEventsResent : Counter::kEventsUnsent);
    if (sent) {
      pipeline_.MarkPublished(event);
    }
  }
}

// The state of a valve whose alarm an earlier session left active, whether it
// sends or not.
void Service::RecoverAlarms() {
  storage::HistoryReader reader(data_.history());
  for (const storage::Alarm& alarm :
       reader.AlarmList(NowNs(), options_.pipeline.max_valves)) {
    if (alarm.state != storage::AlarmState::kReturnedUnacked) {
      states_.Recover(alarm.episode);
    }
  }
}

// An alarm whose data have ended is over once somebody acknowledges it
// (HistoryEditor). That is done by another process or the page, which tell
// nobody, so the history is asked. What it cannot say now stands.
void Service::EndAcknowledgedAlarms() {
  const std::vector<std::uint64_t> waiting = states_.Unconfirmed();
  if (waiting.empty()) {
    return;
  }
  try {
    if (!alarm_reader_) {
      alarm_reader_ = std::make_unique<storage::HistoryReader>(data_.history());
    }
    alarm_reader_->database().Refresh();
    states_.EndUnconfirmed(alarm_reader_->Over(waiting));
  } catch (const std::exception&) {
    alarm_reader_.reset();
  }
}

// The hours of the valves grow, and what they support with them. Nobody is
// alarmed less because the history cannot be read: the last answer stands.
void Service::RefreshBudget() {
  if (between_alarms_h_ == 0.0 || Clock::now() < next_budget_) {
    return;
  }
  next_budget_ = Clock::now() + kBudgetPeriod;
  storage::HistoryReader reader(data_.history());
  const std::vector<HealthyHours> valves =
      storage::ReadHealthyHours(reader.database());
  const auto budget =
      std::make_shared<const AlarmBudget>(between_alarms_h_, valves);
  gate_->Set(budget);
  const AlarmBudget::Promise promise = budget->Now();
  context_.log(
      // Before any valve has its hours, every episode is an alarm, as expected.
      promise.wait_hours == 0.0 || promise.ready == 0 ? LogLevel::kInfo
                                                      : LogLevel::kWarning,
      EventLine("alarm_budget",
                {{"budget", options_.alarm_budget},
                 {"valves", std::to_string(promise.valves)},
                 {"with_tails", std::to_string(promise.ready)},
                 {"needed_h", report::FormatNumber(promise.needed_hours, 0)},
                 {"longest_h", report::FormatNumber(promise.longest_hours, 0)},
                 {"kept", PromiseText(promise)}}));
  for (const HealthyHours& valve : valves) {
    if (valve.damaged) {
      context_.log(LogLevel::kWarning,
                   EventLine("hours_damaged", {{"valve", valve.valve_id}}));
    }
  }
  if (promise.ready == 0) {
    return;  // Nothing has been made rarer yet.
  }
  for (const AlarmBudget::Spender& valve : budget->spenders()) {
    context_.log(LogLevel::kWarning,
                 EventLine("alarm_share_exceeded",
                           {{"valve", valve.valve_id},
                            {"alarms", std::to_string(valve.alarms)},
                            {"share", report::FormatNumber(valve.share, 2)}}));
  }
}

void Service::StartParts() {
  if (options_.parts.empty()) {
    return;
  }
  PartContext part{
      data_, context_.software, started_ns_, context_.log, {}, {}, {}, {}};
  part.facts = [this] {
    const idl::MonitorStatusMessage status = StatusOf(Facts());
    return MonitorFacts{idl::HealthName(status.health), status.counters,
                        pipeline_.census().open_episodes};
  };
  part.guard = [this](std::string_view name,
                      const std::function<void()>& step) {
    Guarded(counters_, log_, name, step);
  };
  part.notify = [this](const report::Json& json) {
    if (hook_) {
      hook_->Notify(json);
    }
  };
  for (const Accumulator& valve : history_.Accumulators()) {
    part.seen.emplace_back(valve.valve_id, valve.stamp_ns);
  }
  for (const auto& each : options_.parts) {
    each->Start(part);
  }
  TellAssignedValves();
}

void Service::TellAssignedValves() {
  const std::vector<std::string> valves = assignment_->AssignedValves();
  for (const auto& part : options_.parts) {
    part->OnAssigned(valves);
  }
}

void Service::ServeProbes() {
  const auto readiness = [this] {
    return Readiness{model_sets_,
                     !pipeline_.history_degraded() && !RecordingDegraded(),
                     samples_.status().matched};
  };
  http_->Add(ProbePages(heartbeat_, {[this] { return Metrics(); }, readiness}));
  http_->Start();
  context_.log(LogLevel::kInfo,
               "http_listening address=" + ToString(http_->address()));
}

// The diagnosis thread: takes samples from the bus and diagnoses them. The
// receive thread has decoded them already, so an intermediate thread would only
// move them. The backlog stays at the subscriber, which stops receiving once it
// holds 16 MB.
void Service::Diagnose() {
  TimePoint
      received{};  // The last sample; when it came, not when it was taken.
  std::int64_t utc_to_steady_ns = 0;
  const idl::Handlers<idl::ValveSampleMessage> handlers{
      [&](const idl::ValveSampleMessage& message,
          const idl::Reception& reception) {
        received = TimePoint(
            std::chrono::nanoseconds(reception.received_ns + utc_to_steady_ns));
        pipeline_.OnSample(message.valve_id, message.sample,
                           reception.writer_id, received);
      },
      [&](const idl::ValveSampleMessage& message,
          const idl::Reception& reception) {
        pipeline_.OnStreamEnded(message.valve_id, reception.writer_id);
      }};
  const auto take = [&](milliseconds timeout) {
    // Recomputed each time, because the UTC clock may have been set.
    utc_to_steady_ns =
        Clock::now().time_since_epoch() / std::chrono::nanoseconds(1) - NowNs();
    return samples_.Take(handlers, timeout, kTakeLimit);
  };
  while (!stopping_) {
    // While samples wait, silence is measured up to the newest one handled.
    const int taken = take(kTakeTimeout);
    pipeline_.Poll(taken < kTakeLimit ? Clock::now() : received);
  }
  // Drains what has arrived already; publishers that continue to send do not
  // delay the shutdown beyond drain_until_.
  while (Clock::now() < drain_until_.load() && take(milliseconds(0)) > 0) {
  }
  pipeline_.FlushDecisions();
}

void Service::Serve(report::StopSignals& signals) {
  if (assignment_->DefaultName() == "none" && assignment_->assigned() == 0) {
    context_.log(
        LogLevel::kWarning,
        EventLine(
            "no_model_set",
            {{"judged", options_.pipeline.loop_audit ? "loops" : "nothing"}}));
  }
  // Not written through the log: scripts wait for this line at every log level.
  const std::string ready =
      "monitor_ready model_set=" + assignment_->DefaultName() +
      " assigned=" + std::to_string(assignment_->assigned()) +
      " valves=" + options_.pipeline.valve_glob +
      " max_valves=" + std::to_string(options_.pipeline.max_valves) +
      " domain=" + std::to_string(context_.options.domain) + "\n";
  report::WriteToStderr(ready);
  options_.on_ready();
  NotifyManager("READY=1");
  TimePoint next_tick = Clock::now();
  std::uint64_t limit_us = 0;
  if (sd_watchdog_enabled(0, &limit_us) > 0) {
    // sd_watchdog_enabled() gives the limit after which the manager ends us;
    // its manual recommends to notify at half of it.
    watchdog_.emplace(heartbeat_, std::chrono::microseconds(limit_us / 2),
                      next_tick);
  }
  while (!Failed()) {
    const TimePoint now = Clock::now();
    service_pulse_.Beat();
    if (now >= next_tick) {
      participant_.RequireInterfaces();
      Tick();
      next_tick = now + kTickPeriod;
    }
    const TimePoint wake = FeedWatchdog(next_tick);
    // The cast truncates: without the added millisecond the last fraction of
    // one would be spent in a busy loop.
    const report::StopSignals::Event event = signals.WaitFor(
        std::chrono::duration_cast<milliseconds>(wake - Clock::now()) +
        milliseconds(1));
    if (event == report::StopSignals::Event::kStop) {
      return;
    }
    if (event == report::StopSignals::Event::kReload) {
      // Under Type=notify-reload the manager requires the time stamp, and takes
      // the reload as finished at READY=1.
      NotifyManager("RELOADING=1\nMONOTONIC_USEC=" + MonotonicMicroseconds());
      Reload("signal");
      NotifyManager("READY=1");
    }
  }
}

// @returns when to be called again, `next_tick` at the latest.
Service::TimePoint Service::FeedWatchdog(TimePoint next_tick) {
  if (!watchdog_) {
    return next_tick;
  }
  const TimePoint now = Clock::now();
  if (watchdog_->Due(now)) {
    NotifyManager("WATCHDOG=1");
  }
  return watchdog_->next() > now ? std::min(watchdog_->next(), next_tick)
                                 : next_tick;
}

// A models.db that cannot be read now does not end the service: the models in
// use stay, and it is read again later, because nobody would change it again.
void Service::Tick() {
  try {
    if (changes_.Changed()) {
      Reload("models_changed");
    } else if (retry_reload_at_ && Clock::now() >= *retry_reload_at_) {
      reload_pause_ = std::min(2 * reload_pause_, kMaxReloadPause);
      *retry_reload_at_ = Clock::now() + reload_pause_;
      ReadModels({});  // Announces nothing, as it may fail for ever.
      LoadModels();
      context_.log(LogLevel::kInfo, "models_reload cause=retry");
    }
  } catch (const std::exception& error) {
    const std::string reason = error.what();
    log_.Report(LogId::kModelFailure, "models_unreadable",
                [&reason] { return "reason=" + LogValue(reason); });
  }
  const auto attempt = [this](std::string_view part, const auto& call) {
    Guarded(counters_, log_, part, call);
  };
  attempt("shares",
          [this] { shares_.Tick([this] { return pipeline_.valve_names(); }); });
  attempt("transport", [this] { ReportLoss(); });
  attempt("heartbeat", [this] { ReportStall(); });
  attempt("alarms", [this] { EndAcknowledgedAlarms(); });
  attempt("alarm_budget", [this] { RefreshBudget(); });
  attempt("status", [this] { PublishStatus(); });
  if (Clock::now() - last_status_line_ >=
      Milliseconds(options_.status_period_s)) {
    last_status_line_ = Clock::now();
    attempt("status_line", [this] {
      context_.log(LogLevel::kInfo, StatusLine(StatusOf(Facts())));
    });
  }
}

// A reload was requested, or the models changed: its outcome is not throttled.
void Service::Reload(const char* cause) {
  context_.log(LogLevel::kInfo, std::string("models_reload cause=") + cause);
  try {
    LoadModels();
  } catch (const std::exception& error) {
    reload_pause_ = kReloadPause;
    retry_reload_at_ = Clock::now() + reload_pause_;
    counters_.Add(Counter::kModelFailures);
    log_.Line(LogLevel::kError, LogLine(LogId::kModelFailure, "reload_failed",
                                        "reason=" + LogValue(error.what())));
  }
}

std::shared_ptr<const ModelAssignment> Service::ReadModels(
    ModelAssignment::Announce announce) const {
  auto next = std::make_shared<const ModelAssignment>(
      data_.models(), options_.model_set, std::move(announce));
  // Loads the sets here, so that the diagnosis thread need not.
  for (const std::string& valve : pipeline_.valve_names()) {
    next->ModelsFor(valve);
  }
  return next;
}

void Service::LoadModels() {
  auto next =
      ReadModels([this](const ModelSet& models) { AnnounceModels(models); });
  assignment_ = next;
  model_sets_ = next->loaded();
  pipeline_.Reassign(std::move(next));
  TellAssignedValves();
  retry_reload_at_.reset();
}

StatusFacts Service::Facts() const {
  idl::DatagramCounts datagrams = participant_.datagrams();
  std::ranges::transform(datagrams, intake_participant_.datagrams(),
                         datagrams.begin(), std::plus<>());
  return {counters_,
          pipeline_.census(),
          samples_.status(),
          datagrams,
          intake_participant_.refused_participants(),
          idl::RefusedPermissions(),
          decisions_.status(),
          pipeline_.journal_backlog(),
          recorder_ ? recorder_->waiting() : 0,
          pipeline_.history_degraded(),
          RecordingDegraded(),
          heartbeat_.StalledSince(Clock::now() - kStallLimit),
          shares_.contested()};
}

std::string Service::Metrics() const {
  MetricsFacts facts{context_.software, started_ns_, data_,
                     heartbeat_.members()};
  try {
    facts.alarms = storage::HistoryReader(data_.history()).CountAlarms(NowNs());
  } catch (const std::exception&) {
    // Without the history nobody can tell; fdi_persistence_degraded says so.
  }
  std::string page = MetricsPage(Facts(), facts);
  Exposition more;
  for (const auto& part : options_.parts) {
    part->AddMetrics(more);
  }
  page += more.text();
  return page;
}

void Service::ReportLoss() {
  const idl::SubscriberStatus dds = samples_.status();
  const std::uint64_t loss =
      dds.lost + dds.undecodable + dds.rejected_instances;
  if (loss != std::exchange(reported_loss_, loss)) {
    log_.Report(LogId::kTransport, "transport_loss", [&dds] {
      return "lost=" + std::to_string(dds.lost) +
             " undecodable=" + std::to_string(dds.undecodable) +
             " rejected_instances=" + std::to_string(dds.rejected_instances) +
             " refused_valves=" + std::to_string(dds.refused_valves);
    });
  }
}

void Service::ReportStall() {
  const auto stalled = heartbeat_.StalledSince(Clock::now() - kStallLimit);
  if (!stalled.empty()) {
    log_.Report(
        LogId::kStalled, "threads_stalled",
        [&stalled] { return "threads=" + JoinText(stalled, ","); },
        LogLevel::kError);
  }
}

void Service::PublishStatus() {
  idl::MonitorStatusMessage status = StatusOf(Facts());
  status.monitor = MonitorName();
  status.software = context_.software;
  status.started_ns = started_ns_;
  status.stamp_ns = NowNs();
  status_topic_.Write(status);
  const std::string line = ManagerLine(status);
  if (line != std::exchange(notified_status_, line)) {
    NotifyManager("STATUS=" + line);
  }
}

void Service::Stop() {
  context_.log(LogLevel::kInfo, "monitor_stopping");
  NotifyManager("STOPPING=1");
  FirstError errors;
  if (http_) {
    errors.Try([this] { http_->Stop(); });
  }
  for (const auto& part : options_.parts) {
    errors.Try([&part] { part->Leave(); });
  }
  errors.Try([this] { StopDiagnosis(); });
  for (const auto& part : options_.parts) {
    errors.Try([&part] { part->Stop(); });
  }
  if (hook_) {
    errors.Try([this] { hook_->Stop(kHookPatience); });
  }
  errors.Try([this] { history_.EndSession(); });
  errors.Try([this] { PublishStatus(); });
  // A subscriber that has not read until now is not given more time.
  if (!publication_stop_.stop_requested()) {
    decisions_.WaitForAcknowledged(kAcknowledgeLimit);
  }
  events_.WaitForAcknowledged(kAcknowledgeLimit);
  status_topic_.WaitForAcknowledged(kAcknowledgeLimit);
  context_.log(LogLevel::kInfo, StatusLine(StatusOf(Facts())));
  context_.log(LogLevel::kInfo, "monitor_stopped");
  // Last, because clients may keep the server's threads busy for a second.
  // These threads use everything above, so they must end within this call.
  http_.reset();
  for (const auto& part : options_.parts) {
    errors.Try([&part] { part->Close(); });
  }
  errors.Rethrow();
}

// Diagnoses, stores and publishes what was received.
void Service::StopDiagnosis() {
  // In this order: the diagnosis thread reads the limit once it sees stopping_.
  // The pipeline stops after that thread has ended, because its calls come from
  // there.
  drain_until_ = Clock::now() + kDrainLimit;
  stopping_ = true;
  samples_.Interrupt();
  // A subscriber that does not read must not prevent the shutdown.
  if (!diagnosis_.WaitFor(kSubscriberPatience)) {
    publication_stop_.request_stop();
  }
  FirstError errors;
  errors.Try([this] { diagnosis_.Join(); });
  // Before the journal, because it may report a gap.
  if (recorder_) {
    errors.Try([this] { recorder_->Stop(); });
  }
  errors.Try([this] { pipeline_.Stop(); });
  errors.Rethrow();
}

}  // namespace fdi::monitor
