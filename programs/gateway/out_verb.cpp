#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "gateway/duties.h"
#include "gateway/mqtt_client.h"
#include "gateway/valve_states.h"
#include "monitor/bus/bus_view.h"
#include "monitor/bus/watch_records.h"
#include "programs/gateway/verbs.h"
#include "report/program.h"
#include "report/stop_signals.h"

namespace fdi::gateway {
namespace {

using Clock = std::chrono::steady_clock;

// Longer than a monitor that runs takes to tell of all its valves.
constexpr std::chrono::seconds kAcquainted(10);
constexpr std::chrono::seconds kTold(1);
constexpr std::chrono::seconds kStopPatience(3);

struct OutOptions {
  MqttOptions mqtt;
  std::string site{"plant"};
  std::string valves{"*"};
  std::string http;
};

// States that the broker has kept from an earlier run: these valves may be
// gone.
class Former {
 public:
  explicit Former(const std::string& prefix) : prefix_(prefix) {}
  std::string pattern() const { return prefix_ + "+/state"; }
  void Take(const MqttEvent& event) {
    constexpr std::string_view kState = "/state";
    if (event.retained && event.topic.starts_with(prefix_) &&
        event.topic.ends_with(kState) && !event.payload.empty()) {
      valves_.push_back(ValveOfLevel(
          std::string_view(event.topic)
              .substr(prefix_.size(),
                      event.topic.size() - prefix_.size() - kState.size())));
    }
  }
  const std::vector<std::string>& valves() const { return valves_; }

 private:
  std::string prefix_;
  std::vector<std::string> valves_;
};

int RunOut(const OutOptions& options, const report::Context& context) {
  if (options.mqtt.url.empty()) {
    throw ConfigError("out takes --mqtt URL");
  }
  ValveStates states(report::LoadFaultTexts(context.options), options.site);
  const Outgoing will = states.Farewell();
  MqttClient client(options.mqtt, {will.topic, will.payload}, context.log);
  Duties duties(options.http);
  report::StopSignals signals;
  signals.EndWithin(kStopPatience);
  monitor::BusView bus({.program = "fdi-gateway out", .valves = options.valves},
                       context, context.log);
  monitor::WatchRecords records(true, [&](const monitor::WatchRecord& record) {
    states.Add(record.object, Clock::now());
  });
  Former former(TopicPrefix(options.site));
  client.Start();
  const std::string ready =
      EventLine("gateway_ready", {{"site", options.site}});
  context.log(LogLevel::kInfo, ready);
  duties.Ready(ready);
  const Clock::time_point start = Clock::now();
  Clock::time_point told = start;
  std::uint64_t published = 0;
  std::vector<MqttEvent> events;
  while (!signals.stop_requested()) {
    bus.Take([&](const auto& message,
                 const auto&) { records.Add(message, Clock::now()); },
             [&](const std::string& valve_id) { states.Remove(valve_id); });
    const Clock::time_point now = Clock::now();
    records.Flush(now);
    client.Take(events, std::chrono::milliseconds(0));
    for (const MqttEvent& event : events) {
      former.Take(event);
      if (event.kind == MqttEvent::Kind::kConnected) {
        client.Subscribe({former.pattern()});
        states.Forget();
        told = {};
      }
    }
    if (client.connected() && now - told >= kTold) {
      told = now;
      if (now - start >= kAcquainted) {
        for (const std::string& valve_id : former.valves()) {
          states.Expect(valve_id);
        }
      }
      for (const Outgoing& message : states.Due(NowNs(), now)) {
        published +=
            client.Publish(message.topic, message.payload, message.retained)
                ? 1U
                : 0U;
      }
    }
    duties.Tick([&] {
      return std::vector<Metric>{
          {"valves", "Valves that are told of.",
           static_cast<double>(states.valves())},
          {"published_total", "Messages that went to the broker.",
           static_cast<double>(published)},
          {"broker_connected", "1 while there is a connection.",
           client.connected() ? 1.0 : 0.0}};
    });
  }
  client.Publish(will.topic, will.payload, true);
  client.Stop();
  return report::kExitOk;
}

}  // namespace

void AddOutVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "out", "Findings of all monitors go to a broker", RunOut);
  options.mqtt.AddTo(verb);
  verb.add_option("--site", options.site,
                  "Name of the plant in the topics fdi/SITE/VALVE/state")
      ->type_name("NAME");
  verb.add_option("--valve", options.valves, "Only ids that match GLOB")
      ->type_name("GLOB");
  verb.add_option("--http", options.http,
                  "Serve /metrics and /healthz on loopback")
      ->type_name("PORT|ADDRESS:PORT");
}

}  // namespace fdi::gateway
