#include <algorithm>
#include <chrono>
#include <iostream>
#include <string>
#include <type_traits>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "programs/monitor/top_board.h"
#include "programs/monitor/verbs.h"
#include "report/live_screen.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::monitor {
namespace {

using Clock = TopBoard::Clock;
using std::chrono::milliseconds;

constexpr milliseconds kRefresh{1000};
constexpr milliseconds kQuiet{1000};  // With --once: after the last new valve.
constexpr milliseconds kSilence{10'000};

struct TopOptions {
  BusOptions bus{.program = "fdi-monitor top"};
  bool once{false};
  double wait_s{5.0};
  std::string sort{kTopSorts.front()};
  std::string filter;

  TopView View(bool utc) const {
    const auto* const found = std::ranges::find(kTopSorts, sort);
    return {static_cast<TopSort>(found - kTopSorts.begin()), filter, utc};
  }
};

void Take(BusView& bus, TopBoard& board) {
  const auto add = [&board](const auto& message,
                            const idl::Reception& reception) {
    board.Hear(reception);
    if constexpr (std::is_same_v<decltype(message),
                                 const idl::DecisionMessage&>) {
      board.Add(message, Clock::now(), reception);
    } else {
      board.Add(message, Clock::now());
    }
  };
  bus.Take(add,
           [&board](const std::string& valve_id) { board.Remove(valve_id); });
}

/// Waits until the monitors' valves have all been heard, and prints them.
int Once(const TopOptions& options, const report::Context& context,
         BusView& bus, TopBoard& board) {
  const report::StopSignals signals;
  const auto start = Clock::now();
  auto newest = start;
  std::size_t valves = 0;
  const std::chrono::duration<double> patience(options.wait_s);
  while (!signals.stop_requested() && Clock::now() - start < patience) {
    Take(bus, board);
    if (board.valves() > valves) {
      valves = board.valves();
      newest = Clock::now();
    }
    const bool heard = valves > 0 && !board.Health(Clock::now()).empty();
    if (heard && Clock::now() - newest > kQuiet) {
      break;
    }
  }
  const TopView view = options.View(context.options.utc);
  const report::Report report =
      board.Valves(view.sort, view.filter, Clock::now());
  if (report.document["monitor"].is_null() && valves == 0) {
    throw NotFoundError("no monitor is heard on domain " +
                        std::to_string(context.options.domain) +
                        ": is one running there, and on the same --interface?");
  }
  if (context.options.json) {
    report.PrintJson(std::cout);
  } else {
    report.PrintText(std::cout, {report::StdoutStyle(), context.options.utc});
  }
  return report::kExitOk;
}

int Live(const TopOptions& options, const report::Context& context,
         BusView& bus, TopBoard& board) {
  report::StopSignals signals;
  // A terminal may have been stopped (Ctrl-S).
  signals.EndWithin(std::chrono::seconds(3));
  const report::LiveScreen screen;
  const TopView view = options.View(context.options.utc);
  auto drawn = Clock::now() - kRefresh;
  while (!signals.stop_requested()) {
    Take(bus, board);
    if (Clock::now() - drawn >= kRefresh) {
      drawn = Clock::now();
      screen.Draw(TopScreen(board, view, report::StdoutStyle(), screen.height(),
                            NowNs(), drawn));
    }
  }
  return report::kExitOk;
}

int RunTop(const TopOptions& options, const report::Context& context) {
  // Log lines would garble the screen.
  const bool live = !options.once && !context.options.json;
  TopBoard board(report::LoadFaultTexts(context.options), kSilence);
  BusView bus(options.bus, context, live ? LogSink() : context.log);
  return live ? Live(options, context, bus, board)
              : Once(options, context, bus, board);
}

}  // namespace

void AddTopVerb(report::Program& program) {
  auto [top, options] = AddVerb(
      program, "top",
      "A live table of valves and their faults, the worst first, from what "
      "monitors publish",
      RunTop);
  top.add_flag("--once", options.once,
               "Print the table once and exit, as --json does");
  top.add_option("--wait", options.wait_s,
                 "With --once: time to wait for a monitor [s]")
      ->check(CLI::Range(0.1, 600.0));
  top.add_option("--sort", options.sort, "worst, valve, factor or since")
      ->check(CLI::IsMember(
          std::vector<std::string>(kTopSorts.begin(), kTopSorts.end())))
      ->capture_default_str();
  top.add_option("--valves", options.bus.valves, "Only ids that match GLOB");
  top.add_option("--filter", options.filter,
                 "Only valves with this text in their id, fault, state or "
                 "quality");
  top.add_option("--max-valves", options.bus.max_valves,
                 "Maximum number of valves")
      ->check(CLI::Range(1, 100000));
}

}  // namespace fdi::monitor
