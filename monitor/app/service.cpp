#include "monitor/app/service.h"

#include <cstdio>
#include <utility>

#include "monitor/app/cause_groups.h"
#include "monitor/app/shadow.h"
#include "monitor/app/status.h"
#include "storage/cli/time_text.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kTakeTimeout{100};
constexpr int kTakeLimit = 4096;  // Under full load Take() has no other end.
constexpr milliseconds kTickPeriod{1000};

std::chrono::milliseconds Milliseconds(double seconds) {
  return milliseconds(static_cast<std::int64_t>(seconds * 1e3));
}

storage::DataDirectory Prepared(const std::filesystem::path& path) {
  storage::DataDirectory data{path};
  storage::EnsureExists(data);
  PrepareModels(data.models());
  return data;
}

idl::DdsOptions DdsOptionsOf(const ServiceOptions& options,
                             const cli::GlobalOptions& global) {
  idl::DdsOptions dds;
  dds.domain = global.domain;
  dds.interfaces = global.interface;
  dds.transport = global.transport;
  dds.qos_file = global.qos_file.string();
  dds.max_valves = options.max_valves;
  return dds;
}

PipelineOptions PipelineOptionsOf(const ServiceOptions& options,
                                  const storage::DataDirectory& data) {
  PipelineOptions pipeline;
  if (options.shadow) {
    pipeline.shadow.candidate = LoadCandidate(data.models(), *options.shadow);
    pipeline.shadow.valve_glob = options.shadow_valves;
  }
  pipeline.max_valves = options.max_valves;
  pipeline.valve_glob = options.valves;
  pipeline.registry.stale_timeout = Milliseconds(options.stale_timeout_s);
  pipeline.registry.trace.before_s = options.trace_before_s;
  pipeline.history.utc_now_ns = cli::NowNs;
  pipeline.recorder.lossless = options.recording == Recording::kLossless;
  return pipeline;
}

std::vector<Heartbeat::Member> Members(const Pipeline& pipeline,
                                       const Pulse& intake,
                                       const Pulse& service) {
  std::vector<Heartbeat::Member> members = pipeline.threads();
  members.push_back({"intake", &intake});
  members.push_back({"service", &service});
  return members;
}

std::vector<storage::CauseGroup> CauseGroupsOf(
    const ServiceOptions& options, const storage::DataDirectory& data) {
  const std::filesystem::path usual = data.path / "groups.toml";
  if (options.groups.empty() && !std::filesystem::exists(usual)) {
    return {};
  }
  return ReadCauseGroups(options.groups.empty() ? usual : options.groups);
}

std::filesystem::path LockOf(const storage::DataDirectory& data) {
  std::filesystem::path path = data.history();
  return path += ".lock";
}

}  // namespace

Service::Service(const ServiceOptions& options, const cli::Context& context)
    : options_(options),
      context_(context),
      http_(options.http ? std::make_unique<HttpServer>(
                               HttpServerOptions{.address = *options.http})
                         : nullptr),
      console_(options.console
                   ? std::make_unique<console::Console>(
                         *options.console, context.options, context.log)
                   : nullptr),
      data_(Prepared(context.options.data_dir)),
      lock_(LockOf(data_), "recording faults"),
      pipeline_options_(PipelineOptionsOf(options, data_)),
      cause_groups_(CauseGroupsOf(options, data_)),
      delivery_(
          options.on_event.empty()
              ? nullptr
              : MakeEventDelivery(options.on_event,
                                  Milliseconds(options.on_event_timeout_s))),
      participant_(DdsOptionsOf(options, context.options), context.log,
                   "fdi-monitor"),
      intake_participant_(DdsOptionsOf(options, context.options), context.log,
                          "fdi-monitor intake"),
      models_topic_(participant_),
      changes_(data_.models()),
      assignment_(std::make_shared<const ModelAssignment>(
          data_.models(), options.model_set,
          [this](const ModelSet& models) { AnnounceModels(models); })),
      model_sets_(assignment_->loaded()),
      history_(data_.history(), context.software, context.command_line,
               cli::NowNs, context.log),
      runs_(options.recording == Recording::kOff
                ? nullptr
                : std::make_unique<RunStore>(data_.runs(), context.software)),
      decisions_(participant_, options.lossless_decisions,
                 publication_stop_.get_token()),
      events_(participant_, context.log),
      outward_(
          delivery_ == nullptr
              ? nullptr
              : std::make_unique<OutwardEvents>(
                    events_, std::move(delivery_),
                    EventHookOptions{.per_minute = options.on_event_per_minute},
                    cli::LoadFaultTexts(context.options), context.log)),
      status_topic_(participant_),
      samples_(
          intake_participant_,
          options.best_effort ? idl::Profile::kBestEffort : idl::Profile::kLive,
          idl::Overflow::kOnTheWay),
      log_(context.log),
      pipeline_(
          pipeline_options_,
          {decisions_, console_ ? console_->Before(EventsOut()) : EventsOut(),
           history_, runs_.get(), console_ ? &console_->live() : nullptr},
          assignment_, counters_, log_),
      heartbeat_(Members(pipeline_, intake_pulse_, service_pulse_)),
      started_ns_(cli::NowNs()),
      last_status_line_(std::chrono::steady_clock::now()) {
  ResendEvents();
  WatchCauses();
  if (console_) {
    ServeConsole();
  }
  pipeline_.Start(history_.OpenEpisodes(), history_.Accumulators(),
                  history_.ShadowAccumulators());
  intake_ = std::jthread([this](const std::stop_token& stop) { Intake(stop); });
  if (http_) {
    ServeProbes();
  }
}

Service::~Service() {
  // Their threads look at all the rest.
  http_.reset();
  if (console_) {
    console_->Close();
  }
}

void Service::AnnounceModels(const ModelSet& models) {
  models_topic_.Write(idl::Describe(models));
  context_.log(LogLevel::kInfo, "models_loaded model_set=" + models.name + "@" +
                                    std::to_string(models.version));
}

void Service::Intake(const std::stop_token& stop) {
  try {
    const idl::Handlers<idl::ValveSampleMessage> handlers{
        [this](const idl::ValveSampleMessage& message,
               const idl::Reception& reception) {
          pipeline_.Offer(message.valve_id, message.sample,
                          reception.writer_id);
        },
        [this](const idl::ValveSampleMessage& message,
               const idl::Reception& reception) {
          pipeline_.OfferEnd(message.valve_id, reception.writer_id);
        }};
    const std::stop_callback wake(stop, [this] { samples_.Interrupt(); });
    while (!stop.stop_requested() && !pipeline_.failed()) {
      samples_.Take(handlers, kTakeTimeout, kTakeLimit);
      pipeline_.AnnounceOffers();
      intake_pulse_.Beat();
    }
    // What is there already; publishers that go on do not keep us.
    while (std::chrono::steady_clock::now() < drain_until_.load() &&
           samples_.Take(handlers, milliseconds(0), kTakeLimit) > 0) {
    }
  } catch (...) {
    intake_error_ = std::current_exception();
    intake_failed_ = true;
  }
}

int Service::Run(cli::StopSignals& signals) {
  // Not through the log: scripts wait for this line at every log level.
  const std::string ready =
      "monitor_ready model_set=" + assignment_->DefaultName() +
      " valves=" + options_.valves +
      " max_valves=" + std::to_string(options_.max_valves) +
      " domain=" + std::to_string(context_.options.domain) + "\n";
  std::fputs(ready.c_str(), stderr);
  manager_.Ready();
  auto next_tick = std::chrono::steady_clock::now();
  if (manager_.watchdog_limit()) {
    watchdog_.emplace(heartbeat_, *manager_.watchdog_limit() / 2, next_tick);
  }
  while (!pipeline_.failed() && !intake_failed_) {
    const auto now = std::chrono::steady_clock::now();
    service_pulse_.Beat();
    if (now >= next_tick) {
      Tick();
      next_tick = now + kTickPeriod;
    }
    const cli::StopSignals::Event event = signals.WaitFor(
        std::chrono::duration_cast<milliseconds>(
            FeedWatchdog(next_tick) - std::chrono::steady_clock::now()) +
        milliseconds(1));
    if (event == cli::StopSignals::Event::kStop) {
      break;
    }
    if (event == cli::StopSignals::Event::kReload) {
      manager_.Reloading();
      Reload("signal");
      manager_.Ready();
    }
  }
  Shutdown();
  pipeline_.Rethrow();
  if (intake_error_) {
    std::rethrow_exception(intake_error_);
  }
  const bool incomplete =
      pipeline_.history_degraded() || pipeline_.recording_degraded();
  return incomplete ? cli::kExitData : cli::kExitOk;
}

// @returns when to look again, `next_tick` at the latest.
Service::TimePoint Service::FeedWatchdog(TimePoint next_tick) {
  if (!watchdog_) {
    return next_tick;
  }
  const TimePoint now = std::chrono::steady_clock::now();
  if (watchdog_->Tell(now)) {
    manager_.Alive();
  }
  return watchdog_->next() > now ? std::min(watchdog_->next(), next_tick)
                                 : next_tick;
}

void Service::Tick() {
  try {
    if (changes_.Changed()) {
      Reload("models_changed");
    }
  } catch (const std::exception& error) {
    const std::string reason = error.what();
    log_.Report(LogId::kModelFailure, "models_unreadable",
                [&reason] { return "reason=\"" + reason + "\""; });
  }
  ReportLoss();
  ReportStall();
  PublishStatus();
  if (std::chrono::steady_clock::now() - last_status_line_ >=
      Milliseconds(options_.status_period_s)) {
    last_status_line_ = std::chrono::steady_clock::now();
    WriteStatusLine();
  }
}

void Service::Reload(const char* cause) {
  context_.log(LogLevel::kInfo, std::string("models_reload cause=") + cause);
  try {
    auto next = std::make_shared<const ModelAssignment>(
        data_.models(), options_.model_set,
        [this](const ModelSet& models) { AnnounceModels(models); });
    // Loads here what the diagnosis would otherwise wait for.
    for (const std::string& valve : pipeline_.valve_names()) {
      next->ModelsFor(valve);
    }
    assignment_ = next;
    model_sets_ = next->loaded();
    pipeline_.Reassign(std::move(next));
  } catch (const std::exception& error) {
    counters_.Add(Counter::kModelFailures);
    const std::string reason = error.what();
    log_.Report(
        LogId::kModelFailure, "reload_failed",
        [&reason] { return "reason=\"" + reason + "\""; }, LogLevel::kError);
  }
}

}  // namespace fdi::monitor
