#include <chrono>
#include <cstdint>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>

#include "idl/endpoint.h"
#include "monitor/app/dds_options.h"
#include "monitor/app/verbs.h"
#include "monitor/app/watch_print.h"
#include "monitor/valve_directory.h"
#include "storage/cli/program.h"
#include "storage/cli/stop_signals.h"

namespace fdi::monitor {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kTakeTimeout{50};

struct WatchOptions {
  bool count{false};
  std::string valves{"*"};
  bool lossless{false};
  bool events_only{false};
  int max_valves{2000};
  double for_s{0.0};   // 0: no limit
  double idle_s{0.0};  // 0: no limit
  std::uint64_t expect{0};
};

bool Passed(Clock::time_point since, double seconds) {
  return seconds > 0.0 &&
         Clock::now() - since > std::chrono::duration<double>(seconds);
}

/// What is on the bus, printed or counted.
class Watch {
 public:
  Watch(const WatchOptions& options, const cli::Context& context)
      : options_(options),
        json_(context.options.json),
        printer_(context.options.utc),
        participant_(DdsOptionsOf(context.options, options.max_valves),
                     context.log, "fdi-monitor watch"),
        models_(participant_),
        events_(participant_),
        status_(participant_) {
    if (!options.events_only) {
      decisions_.emplace(participant_, options.lossless
                                           ? idl::Profile::kLossless
                                           : idl::Profile::kLive);
    }
  }

  /// @returns whether all that was expected came.
  bool Run(cli::StopSignals& signals) {
    const Clock::time_point start = Clock::now();
    last_message_ = start;
    while (!signals.stop_requested() && !Passed(start, options_.for_s) &&
           !Passed(last_message_, options_.idle_s) && !Satisfied()) {
      Take();
    }
    return options_.expect == 0 || Satisfied();
  }

  void PrintCounts() const {
    cli::Json counts{{"decision_vectors", decision_count_},
                     {"fault_events", event_count_},
                     {"valves", valves_.size()},
                     {"monitor_status", status_count_},
                     {"model_sets", model_count_},
                     {"lost", Lost()}};
    if (json_) {
      cli::PrintJson(std::cout, counts);
      return;
    }
    for (const auto& [name, value] : counts.items()) {
      std::cout << name << ' ' << value << '\n';
    }
  }

 private:
  bool Satisfied() const {
    return options_.expect > 0 && decision_count_ >= options_.expect;
  }

  std::uint64_t Lost() const {
    const auto lost = [](const idl::SubscriberStatus& status) {
      return status.lost + status.undecodable + status.rejected_instances;
    };
    return lost(events_.status()) + lost(status_.status()) +
           (decisions_ ? lost(decisions_->status()) : 0);
  }

  void Take() {
    // The models first: they explain the vectors.
    models_.Take({[this](const auto& message, const auto&) {
                    ++model_count_;
                    printer_.Learn(message);
                    Print(message);
                  },
                  {}},
                 milliseconds(0));
    events_.Take({[this](const auto& message, const auto&) {
                    if (Matches(message.valve_id)) {
                      ++event_count_;
                      last_message_ = Clock::now();
                      Print(message);
                    }
                  },
                  {}},
                 decisions_ ? milliseconds(0) : kTakeTimeout);
    status_.Take({[this](const auto& message, const auto&) {
                    ++status_count_;
                    Print(message);
                  },
                  {}},
                 milliseconds(0));
    if (decisions_) {
      decisions_->Take({[this](const auto& message, const auto&) {
                          if (Matches(message.valve_id)) {
                            ++decision_count_;
                            last_message_ = Clock::now();
                            valves_.insert(message.valve_id);
                            Print(message);
                          }
                        },
                        {}},
                       kTakeTimeout, 1000);
    }
    if (!options_.count) {
      std::cout.flush();
    }
  }

  bool Matches(const std::string& valve_id) const {
    return options_.valves == "*" || GlobMatches(options_.valves, valve_id);
  }

  template <typename Message>
  void Print(const Message& message) const {
    if (options_.count) {
      return;
    }
    if (json_) {
      std::cout << printer_.Object(message).dump(
                       -1, ' ', false, cli::Json::error_handler_t::replace)
                << '\n';
    } else {
      std::cout << printer_.Line(message) << '\n';
    }
  }

  WatchOptions options_;
  bool json_;
  WatchPrinter printer_;
  idl::Participant participant_;
  idl::Subscriber<idl::ModelSetInfoMessage> models_;
  idl::Subscriber<idl::FaultEventMessage> events_;
  idl::Subscriber<idl::MonitorStatusMessage> status_;
  std::optional<idl::Subscriber<idl::DecisionMessage>> decisions_;
  Clock::time_point last_message_;
  std::uint64_t decision_count_{0};
  std::uint64_t event_count_{0};
  std::uint64_t status_count_{0};
  std::uint64_t model_count_{0};
  std::set<std::string> valves_;
};

int RunWatch(const WatchOptions& options, const cli::Context& context) {
  cli::StopSignals signals;
  Watch watch(options, context);
  std::cerr << "watch_ready domain=" << context.options.domain << '\n';
  const bool complete = watch.Run(signals);
  if (options.count) {
    watch.PrintCounts();
  }
  return complete ? cli::kExitOk : cli::kExitFailure;
}

}  // namespace

void AddWatchVerb(cli::Program& program) {
  auto options = std::make_shared<WatchOptions>();
  CLI::App& watch = program.AddVerb(
      "watch", "Print what monitors publish: decision vectors, fault events",
      [options](const cli::Context& context) {
        return RunWatch(*options, context);
      });
  watch.add_flag("--count", options->count,
                 "Print only how many messages came, at the end");
  watch.add_option("--valves", options->valves, "Only ids that match GLOB");
  watch.add_flag("--lossless", options->lossless,
                 "Miss no decision vector of a monitor that runs with "
                 "--lossless-decisions");
  watch.add_flag("--events", options->events_only, "No decision vectors");
  watch
      .add_option("--max-valves", options->max_valves,
                  "Room for so many valves")
      ->check(CLI::Range(1, 100000));
  watch.add_option("--for", options->for_s, "Stop after so long [s]")
      ->check(CLI::NonNegativeNumber);
  watch
      .add_option("--idle", options->idle_s,
                  "Stop after so long without a vector or event [s]")
      ->check(CLI::NonNegativeNumber);
  watch.add_option("--expect", options->expect,
                   "Stop after N decision vectors; exit code 1 if fewer came");
}

}  // namespace fdi::monitor
