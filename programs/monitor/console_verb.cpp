#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <type_traits>

#include <CLI/CLI.hpp>

#include "base/mutex.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "console/console.h"
#include "console/plant_feed.h"
#include "diagnosis/records/valve_glob.h"
#include "monitor/bus/bus_view.h"
#include "monitor/throttled_log.h"
#include "plant/plant_reader.h"
#include "programs/monitor/console.h"
#include "programs/monitor/planner_page.h"
#include "programs/monitor/verbs.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::monitor {
namespace {

struct PlantConsoleOptions {
  std::string url;
  PageOptions page{.address = "127.0.0.1:8081"};
  BusOptions bus{.program = "fdi-monitor console"};
};

// OK if there is at least one monitor and all of them are healthy.
console::MonitorFacts FactsOf(const std::vector<console::MonitorLine>& lines) {
  const bool well =
      !lines.empty() && std::ranges::all_of(lines, [](const auto& line) {
        return !line.silent && line.health == "OK";
      });
  return {well ? "OK" : "DEGRADED", {}, 0};
}

// Short: people wait for the answer, and after one failure all get it at once.
storage::PlantLimits Limits(const std::stop_token& stop) {
  storage::PlantLimits limits;
  limits.connect = std::chrono::seconds(5);
  limits.lock = std::chrono::seconds(5);
  limits.statement = std::chrono::seconds(10);
  limits.stop = stop;
  return limits;
}

// Waits for `pause`, or until `stop` if that comes first.
void PauseUntil(const std::stop_token& stop, std::chrono::seconds pause) {
  Mutex mutex;
  std::condition_variable_any stopped;
  MutexLock lock(mutex);
  stopped.wait_for(lock, stop, pause, [] { return false; });
}

// Lists valves also if they are silent. Tried again until the plant's history
// answers; that it is away is on the page already.
void ExpectSeenValves(const std::stop_token& stop,
                      const PlantConsoleOptions& options,
                      console::LiveBoard& board) {
  constexpr std::int64_t kAgeNs =
      std::chrono::nanoseconds(console::PlantFeed::kForgetValve).count();
  constexpr std::chrono::seconds kRetry{10};
  while (!stop.stop_requested()) {
    try {
      storage::PlantReader plant(options.url, "", Limits(stop));
      for (const auto& [valve, last_ns] : plant.SeenValves(NowNs() - kAgeNs)) {
        if (GlobMatches(options.bus.valves, valve)) {
          board.Expect(valve, last_ns);
        }
      }
      return;
    } catch (const std::exception&) {
      PauseUntil(stop, kRetry);
    }
  }
}

int RunConsole(const PlantConsoleOptions& options,
               const report::Context& context) {
  const LogSink log = LimitLog(context.log);
  report::StopSignals signals(report::StopSignals::HangUp::kStop);
  std::stop_source stopping;
  const std::int64_t started_ns = NowNs();
  std::optional<console::PlantFeed> feed;  // Outlives the console's threads.
  console::Console console(
      {ParseHttpAddress(options.page.address, "--listen"), options.page.files,
       options.page.proxy_secret, PlannerRoutes({}, context)},
      context.options, log);
  feed.emplace(console.live());
  BusView bus(options.bus, context, log);
  console.Start({{},
                 {},
                 context.software,
                 started_ns,
                 [&feed] { return FactsOf(feed->monitors()); },
                 NowNs,
                 [url = options.url, stop = stopping.get_token()] {
                   return std::make_unique<storage::PlantReader>(url, "",
                                                                 Limits(stop));
                 },
                 [&feed] { return feed->monitors(); }});
  const std::jthread expecting([&](const std::stop_token& stop) {
    ExpectSeenValves(stop, options, console.live());
  });
  while (!signals.stop_requested()) {
    bus.Take(
        [&](const auto& message, const idl::Reception& reception) {
          using Message = std::decay_t<decltype(message)>;
          if constexpr (std::is_same_v<Message, FaultEvent>) {
            console.OnEvent(message);
          } else if constexpr (std::is_same_v<Message,
                                              idl::ModelSetInfoMessage>) {
            console.OnModels(feed->Add(message));
          } else {
            feed->Add(message, reception, console::PlantFeed::Clock::now());
          }
        },
        [](const std::string& /*valve_id*/) {});
    feed->Poll(console::PlantFeed::Clock::now());
  }
  stopping.request_stop();
  console.Close();
  return report::kExitOk;
}

}  // namespace

void AddConsoleVerb(report::Program& program) {
  auto [console, options] = AddVerb(
      program, "console",
      "Serve one live page of all monitors on the bus; their episodes come "
      "from "
      "the plant's history (fdi-store ship). It diagnoses nothing",
      RunConsole);
  console
      .add_option("--db", options.url,
                  "The plant's history: postgresql://user@host/database")
      ->required()
      ->type_name("URL");
  console
      .add_option("--listen", options.page.address,
                  "Where to serve it; a PORT alone is on loopback, port 0 any "
                  "free one")
      ->capture_default_str()
      ->type_name("ADDRESS:PORT");
  AddPageFiles(console, options.page);
  console.add_option("--valve", options.bus.valves, "Only ids that match GLOB")
      ->type_name("GLOB");
  console
      .add_option("--max-valves", options.bus.max_valves,
                  "Maximum number of valves")
      ->check(CLI::Range(1, 100000));
}

}  // namespace fdi::monitor
