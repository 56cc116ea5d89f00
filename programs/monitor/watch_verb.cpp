#include <chrono>
#include <cstdint>
#include <iostream>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/time_text.h"
#include "monitor/bus/watch_records.h"
#include "monitor/bus/watch_table.h"
#include "programs/monitor/verbs.h"
#include "report/json_output.h"
#include "report/live_screen.h"
#include "report/logging.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::monitor {
namespace {

using Clock = WatchRecords::Clock;

struct WatchOptions {
  BusOptions bus{.program = "fdi-monitor watch"};
  bool totals{false};
  bool table{false};
  bool lossless{false};
  bool events_only{false};
  double for_s{0.0};  // 0: no limit
  std::uint64_t expect{0};
};

struct WatchCounts {
  std::uint64_t decisions{0};
  std::uint64_t events{0};
  std::uint64_t states{0};
  std::uint64_t status{0};
  std::uint64_t models{0};
  std::set<std::string> valves;

  void Add(const idl::DecisionMessage& message) {
    ++decisions;
    valves.insert(message.valve_id);
  }
  void Add(const FaultEvent& /*message*/) { ++events; }
  void Add(const idl::ValveStateMessage& /*message*/) { ++states; }
  void Add(const idl::MonitorStatusMessage& /*message*/) { ++status; }
  void Add(const idl::ModelSetInfoMessage& /*message*/) { ++models; }
};

constexpr std::chrono::seconds kStopPatience{3};
constexpr std::chrono::seconds kRefresh{1};  // Period of the table.

bool Passed(Clock::time_point since, double seconds) {
  return seconds > 0.0 &&
         Clock::now() - since > std::chrono::duration<double>(seconds);
}

void PrintCounts(const WatchCounts& counts, std::uint64_t lost, bool json) {
  const report::Json object{{"decision_vectors", counts.decisions},
                            {"fault_events", counts.events},
                            {"valves", counts.valves.size()},
                            {"valve_states", counts.states},
                            {"monitor_status", counts.status},
                            {"model_sets", counts.models},
                            {"lost", lost}};
  if (json) {
    std::cout << report::JsonText(object, 2) << '\n';
    return;
  }
  for (const auto& [name, value] : object.items()) {
    std::cout << name << ' ' << value << '\n';
  }
}

// Shows the table every second: on a terminal in place of the last one,
// else below it.
class TableOutput {
 public:
  TableOutput(const report::Context& context, bool in_place)
      : json_(context.options.json),
        table_(report::LoadFaultTexts(context.options), context.options.utc) {
    if (in_place) {
      screen_.emplace();
    }
  }
  WatchTable& table() { return table_; }

  void ShowWhenDue(Clock::time_point now) {
    if (now - shown_ >= kRefresh) {
      Show(now);
    }
  }
  void Show(Clock::time_point now) {
    shown_ = now;
    if (screen_) {
      screen_->Draw(table_.Text(screen_->height(), NowNs(), now));
    } else if (json_) {
      std::cout << report::JsonText(table_.Valves(NowNs(), now).document)
                << '\n';
    } else {
      std::cout << table_.Text(kAllLines, NowNs(), now) << '\n';
    }
  }

 private:
  static constexpr auto kAllLines = std::numeric_limits<std::size_t>::max();

  bool json_;
  WatchTable table_;
  std::optional<report::LiveScreen> screen_;
  Clock::time_point shown_{Clock::now()};
};

// True if the table is redrawn in place. Limited output is for a file, even if
// it is shown on a terminal.
bool IsInPlace(const WatchOptions& options, bool json) {
  return options.table && !json && options.for_s == 0.0 &&
         options.expect == 0 && isatty(STDOUT_FILENO) != 0;
}

int RunWatch(const WatchOptions& given, const report::Context& context) {
  WatchOptions options = given;
  if (options.events_only || (options.table && options.expect == 0)) {
    options.bus.vectors = Vectors::kNone;
  } else if (options.lossless) {
    options.bus.vectors = Vectors::kAll;
  }
  report::StopSignals signals;
  // Whoever reads the output may have stopped reading.
  signals.EndWithin(kStopPatience);
  const bool json = context.options.json;
  const bool in_place = IsInPlace(options, json);
  // Log lines would garble the screen.
  BusView bus(options.bus, context, in_place ? LogSink() : context.log);
  if (!in_place) {
    report::WriteToStderr(
        "watch_ready domain=" + std::to_string(context.options.domain) + "\n");
  }
  std::optional<TableOutput> output;
  if (options.table) {
    output.emplace(context, in_place);
  }
  WatchRecords records(context.options.utc, [&](const WatchRecord& record) {
    if (output) {
      output->table().Add(record.object, Clock::now());
      return;
    }
    std::cout << (json ? report::JsonText(record.object) : record.line) << '\n';
  });
  WatchCounts counts;
  const Clock::time_point start = Clock::now();
  const auto satisfied = [&] {
    return options.expect > 0 && counts.decisions >= options.expect;
  };
  while (!signals.stop_requested() && !Passed(start, options.for_s) &&
         !satisfied()) {
    bus.Take(
        [&](const auto& message, const auto&) {
          counts.Add(message);
          if (!options.totals) {
            records.Add(message, Clock::now());
          }
        },
        [&](const std::string& valve_id) {
          if (output) {
            output->table().Remove(valve_id);
          }
        });
    records.Flush(Clock::now());
    if (output) {
      output->ShowWhenDue(Clock::now());
    }
    std::cout.flush();
  }
  // Records that still wait for their model set are printed without its names.
  records.Flush(Clock::time_point::max());
  if (output && !in_place) {
    output->Show(Clock::now());
  }
  if (options.totals) {
    PrintCounts(counts, bus.lost(), json);
  }
  return options.expect == 0 || satisfied() ? report::kExitOk
                                            : report::kExitFailure;
}

}  // namespace

void AddWatchVerb(report::Program& program) {
  auto [watch, options] = AddVerb(
      program, "watch",
      "Print what monitors publish: decision vectors, fault events, states",
      RunWatch);
  CLI::Option* const totals =
      watch.add_flag("--totals", options.totals,
                     "Print only how many messages came, at the end");
  CLI::Option* const table =
      watch
          .add_flag("--table", options.table,
                    "Show a table of valves each second instead, the worst "
                    "first")
          ->excludes(totals);
  watch.add_option("--valve", options.bus.valves, "Only ids that match GLOB")
      ->type_name("GLOB");
  watch.add_flag("--lossless", options.lossless,
                 "Every decision vector of monitors that run with "
                 "--lossless-decisions");
  watch.add_flag("--events", options.events_only, "Leave out decision vectors")
      ->excludes(table);
  watch
      .add_option("--max-valves", options.bus.max_valves,
                  "Maximum number of valves")
      ->check(CLI::Range(1, 100000));
  watch
      .add_option("--for", options.for_s, "Stop after this time [s]; 0: never")
      ->check(CLI::NonNegativeNumber);
  watch.add_option("--expect", options.expect,
                   "Stop after N decision vectors; exit code 1 if fewer came");
}

}  // namespace fdi::monitor
