#include <filesystem>
#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/headroom.h"
#include "diagnosis/decision/alarm_budget.h"
#include "monitor/service/service.h"
#include "monitor/service/start_notice.h"
#include "monitor/throttled_log.h"
#include "programs/monitor/console.h"
#include "programs/monitor/http_option.h"
#include "programs/monitor/planner.h"
#include "programs/monitor/verbs.h"
#include "report/help.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::monitor {
namespace {

/// Half for a monitor with console and records, half for its clients.
constexpr int kDescriptors = 96;

struct RunArguments {
  std::string model_set;
  std::string record{"off"};
  std::string http{"off"};
  PageOptions page;
  std::filesystem::path groups;
  ServiceOptions service;
};

// A flag with an optional value; TOML may give it as true or false.
// In CLI11, default_str() of an option with expected(0, 1) is its value if it
// is given bare (--record). If it is not given, its variable stays as it is,
// here "off".
std::string ParseRecord(const std::string& word) {
  if (word == "true" || word == "on") {
    return "on";
  }
  if (word == "false" || word == "off") {
    return "off";
  }
  if (word != "lossless") {
    throw CLI::ValidationError("--record",
                               word + " is none of on, lossless, off");
  }
  return word;
}

// Empty: it is one.
std::string CheckBudget(const std::string& text) {
  try {
    if (text != "off") {
      ParseAlarmBudget(text);
    }
  } catch (const ConfigError& error) {
    return error.what() + std::string(", or off");
  }
  return "";
}

void AddOnEventOptions(CLI::App& run, ServiceOptions& service) {
  run.add_option("--on-event", service.on_event,
                 "Notify of every fault event: a command that reads it as JSON "
                 "from its standard input")
      ->type_name("CMD");
  run.add_option("--on-event-rate", service.on_event_per_minute,
                 "At most this many a minute; the rest is counted")
      ->check(CLI::Range(1, 6000))
      ->capture_default_str();
}

int Run(const RunArguments& arguments, const report::Context& context) {
  ServiceOptions options = arguments.service;
  if (!arguments.model_set.empty()) {
    options.model_set = storage::ParseModelReference(arguments.model_set);
  }
  if (arguments.record != "off") {
    options.recording =
        arguments.record == "lossless" ? Recording::kLossless : Recording::kOn;
  }
  if (arguments.http != "off") {
    options.http = ParseHttpAddress(arguments.http, "--http");
  }
  // Some 25 threads, 60 with the console, and 50 files: a lack is said before
  // the bus or a file is touched.
  RequireDescriptors(kDescriptors);
  RequireHeadroom(arguments.page.address != "off" ? 64 : 32, 64U << 20U);
  // Before the service, so that a signal during its start requests an orderly
  // stop.
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  const report::Context limited{context.options, LimitLog(context.log),
                                context.software, context.command_line};
  for (auto& part : {FollowCauses(arguments.groups, limited),
                     MakePage(arguments.page, arguments.groups,
                              options.pipeline.valve_glob, limited)}) {
    if (part) {
      options.parts.push_back(part);
    }
  }
  StartNotice starting(NotifyManager);
  starting.Start();
  options.on_ready = [&starting] { starting.Stop(); };
  Service service(options, limited);
  return service.Run(signals);
}

// Who judges beside the observers.
void AddJudgeOptions(CLI::App& run, PipelineOptions& pipeline) {
  run.add_flag("!--no-second-look", pipeline.second_look,
               "Name faults as the observers do, without the second look by "
               "the physics of an onboarded valve");
  run.add_flag("!--no-loop-audit", pipeline.loop_audit,
               "Leave valves without a model set unjudged, without the audit "
               "of their loops");
  run.add_flag("--audit-all-loops", pipeline.audit_all_loops,
               "Audit also the loops of valves with a model set, while that "
               "finds nothing");
}

}  // namespace

void AddRunVerb(report::Program& program) {
  auto [run, arguments] =
      AddVerb(program, "run",
              "Diagnose the valves on the bus until SIGINT or SIGTERM", Run);
  run.add_option("--model-set", arguments.model_set,
                 "NAME[@VERSION] for valves without a set of their own "
                 "(default: the only active set, if no valve has its own)");
  run.add_option("--record", arguments.record,
                 "Store the samples as runs; =lossless waits for the disk "
                 "instead of counting what it could not take")
      ->expected(0, 1)
      ->default_str("on")
      ->transform(ParseRecord)
      ->type_name("[=on|lossless|off]");
  ServiceOptions& service = arguments.service;
  PipelineOptions& pipeline = service.pipeline;
  run.add_option("--valve", pipeline.valve_glob,
                 "Serve only ids that match GLOB")
      ->capture_default_str()
      ->type_name("GLOB");
  run.add_option("--max-valves", pipeline.max_valves,
                 "Serve at most N valves, count the others")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  run.add_flag("--lossless-decisions", service.lossless_decisions,
               "Publish every decision vector on fdi/v1/DecisionBatch, too; a "
               "slow subscriber of it holds the monitor up");
  run.add_flag("--best-effort", service.best_effort,
               "Take samples without retransmission");
  AddJudgeOptions(run, pipeline);
  run.add_option("--stale-timeout", pipeline.stale_timeout_s,
                 "Close an episode when its valve was silent for this time [s]")
      ->check(CLI::Range(1.0, 1e7))
      ->capture_default_str();
  AddGroupsOption(program, run, arguments.groups);
  AddOnEventOptions(run, service);
  run.add_option("--alarm-budget", service.alarm_budget,
                 "False alarms that all valves together may raise, for example "
                 "1/day: what healthy valves show more often is a notice, once "
                 "enough of their hours are known; off: every episode is an "
                 "alarm")
      ->check(CheckBudget)
      ->type_name("N/PERIOD|off")
      ->capture_default_str();
  AddHttpOption(run, "--http", arguments.http, "127.0.0.1:9464",
                "Serve /metrics, /healthz and /readyz; port 0: any free one");
  AddPageOptions(program, run, arguments.page);
  run.add_option("--status-period", service.status_period_s,
                 "Time between status lines in the log [s]")
      ->check(CLI::Range(1.0, 86400.0))
      ->capture_default_str();
  report::ShowInHelpAll(
      run, {"--lossless-decisions", "--best-effort", "--audit-all-loops",
            "--on-event-rate", "--console-files", "--status-period",
            "--stale-timeout"});
}

}  // namespace fdi::monitor
