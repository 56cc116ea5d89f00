#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/records/valve_glob.h"
#include "gateway/duties.h"
#include "gateway/mqtt_client.h"
#include "gateway/sparkplug_node.h"
#include "gateway/valve_states.h"
#include "import/plant_table.h"
#include "monitor/bus/bus_view.h"
#include "monitor/bus/watch_records.h"
#include "programs/gateway/verbs.h"
#include "report/program.h"
#include "report/stop_signals.h"
#include "storage/database/data_directory.h"
#include "storage/history/history_reader.h"

namespace fdi::gateway {
namespace {

using Clock = std::chrono::steady_clock;

// Longer than a monitor that runs takes to tell of all its valves.
constexpr std::chrono::seconds kAcquainted(10);
constexpr std::chrono::seconds kTold(1);
constexpr std::chrono::seconds kStopPatience(3);

struct OutOptions {
  MqttOptions mqtt;
  std::string lines;
  std::string plant;
  std::string site{"plant"};
  std::string valves{"*"};
  std::string http;
};

// The alarms as operators have left them, from the history of a monitor on this
// host.
class AlarmReader {
 public:
  AlarmReader(std::string valves, const report::Context& context)
      : valves_(std::move(valves)),
        path_(storage::DataDirectory{context.options.data_dir}.history()),
        log_(context.log) {}

  /// Nothing where there is no history, or where it cannot be read.
  std::optional<std::vector<storage::Alarm>> Read() {
    try {
      if (!history_ && !std::filesystem::exists(path_)) {
        return std::nullopt;
      }
      if (!history_) {
        history_ = std::make_unique<storage::HistoryReader>(path_);
      }
      history_->Version();  // Opens a file again if it was replaced.
      auto alarms = history_->AlarmList(NowNs());
      std::erase_if(alarms, [this](const storage::Alarm& alarm) {
        return !GlobMatches(valves_, alarm.episode.valve_id);
      });
      return alarms;
    } catch (const std::exception& error) {
      history_.reset();
      log_.Warn("history_unreadable", path_, {{"reason", error.what()}});
      return std::nullopt;
    }
  }

 private:
  std::string valves_;
  std::filesystem::path path_;
  CalmLog log_;
  std::unique_ptr<storage::HistoryReader> history_;
};

// Where messages go.
class Outlet {
 public:
  virtual ~Outlet() = default;
  virtual bool Publish(const Outgoing& message) = 0;
  // @returns whether messages can go out now; tells `states` what to say again.
  virtual bool Ready(ValveStates& states) = 0;
  // A valve that no monitor has told of by now is missing.
  virtual bool KnowsAll() const { return true; }
  virtual void End(const Outgoing& farewell) = 0;
};

// To a broker; with --sparkplug as an edge node.
class BrokerOutlet : public Outlet {
 public:
  BrokerOutlet(const OutOptions& options, const Outgoing& will,
               const LogSink& log)
      : client_(
            options.mqtt, [this, will] { return node_ ? node_->Will() : will; },
            log) {
    if (!options.mqtt.sparkplug.empty()) {
      node_.emplace(options.mqtt.sparkplug, options.site);
    }
    client_.Start();
  }
  bool Publish(const Outgoing& message) override {
    if (!node_) {
      return client_.Publish(message);
    }
    bool sent = false;
    for (const Outgoing& part : node_->Tell(message)) {
      sent = client_.Publish(part);
    }
    return sent;
  }
  bool Ready(ValveStates& states) override {
    client_.Take(events_, std::chrono::milliseconds(0));
    bool begin = false;
    for (const MqttEvent& event : events_) {
      if (event.kind == MqttEvent::Kind::kConnected) {
        client_.Subscribe({node_ ? node_->commands() : states.kept_topics()});
        begin = true;
      }
      states.TakeKept(event);
      begin = begin || (node_ && SparkplugNode::AsksForBirth(event.payload));
    }
    if (begin) {
      if (node_) {
        client_.Publish(node_->Birth());
      }
      states.Forget();
    }
    return client_.connected();
  }
  // The states that the broker has kept stand until the monitors were heard.
  bool KnowsAll() const override {
    return Clock::now() - start_ >= kAcquainted;
  }
  void End(const Outgoing& farewell) override {
    client_.Publish(node_ ? node_->Death() : farewell);
    client_.Stop();
  }

 private:
  std::optional<SparkplugNode> node_;
  MqttClient client_;
  std::vector<MqttEvent> events_;
  Clock::time_point start_{Clock::now()};
};

// A line a message, {"topic", "payload"}, and one a second, so that its reader
// knows that this program lives.
class LineOutlet : public Outlet {
 public:
  explicit LineOutlet(const std::string& path) {
    if (path != "-") {
      file_.open(path);
      if (!file_) {
        throw DataError("--lines: " + path +
                        " cannot be written: " + std::strerror(errno));
      }
      out_ = &file_;
    }
  }
  bool Publish(const Outgoing& message) override {
    *out_ << "{\"topic\":" << report::JsonText(message.topic)
          << ",\"payload\":" << message.payload << "}\n";
    return true;
  }
  bool Ready(ValveStates& /*states*/) override {
    const auto now = Clock::now();
    if (now - alive_ >= kTold) {
      alive_ = now;
      *out_ << "{\"topic\":null}" << std::endl;
    }
    if (!*out_) {
      throw DataError("--lines: nobody reads what is written");
    }
    return true;
  }
  void End(const Outgoing& farewell) override {
    Publish(farewell);
    out_->flush();
  }

 private:
  std::ofstream file_;
  std::ostream* out_{&std::cout};
  Clock::time_point alive_;
};

std::unique_ptr<Outlet> OpenOutlet(const OutOptions& options,
                                   const Outgoing& will, const LogSink& log) {
  if (options.lines.empty() == options.mqtt.url.empty()) {
    throw ConfigError("out takes one of --mqtt URL and --lines FILE|-");
  }
  if (!options.lines.empty()) {
    return std::make_unique<LineOutlet>(options.lines);
  }
  return std::make_unique<BrokerOutlet>(options, will, log);
}

// The valves of the plant's table are told of whether or not a monitor does.
void ExpectTable(const OutOptions& options, ValveStates& states) {
  if (options.plant.empty()) {
    return;
  }
  for (const importer::PlantRow& row :
       importer::ReadPlantTable(options.plant).rows) {
    if (!row.name.empty() && GlobMatches(options.valves, row.name)) {
      states.Expect(row.name);
      states.Describe(row.name, row.group, row);
    }
  }
}

int RunOut(const OutOptions& options, const report::Context& context) {
  ValveStates states(report::LoadFaultTexts(context.options), options.site);
  ExpectTable(options, states);
  Duties duties(options.http);
  report::StopSignals signals;
  signals.EndWithin(kStopPatience);
  monitor::BusView bus({.program = "fdi-gateway out", .valves = options.valves},
                       context, context.log);
  monitor::WatchRecords records(true, [&](const monitor::WatchRecord& record) {
    states.Add(record.object, Clock::now());
  });
  AlarmReader alarms(options.valves, context);
  const Outgoing farewell = states.Farewell();
  const auto outlet = OpenOutlet(options, farewell, context.log);
  const std::string ready =
      EventLine("gateway_ready", {{"site", options.site}});
  context.log(LogLevel::kInfo, ready);
  duties.Ready(ready);
  Clock::time_point told;
  std::uint64_t published = 0;
  bool connected = false;
  while (!signals.stop_requested()) {
    bus.Take([&](const auto& message,
                 const auto&) { records.Add(message, Clock::now()); },
             [&](const std::string& valve_id) { states.Remove(valve_id); });
    const Clock::time_point now = Clock::now();
    records.Flush(now);
    connected = outlet->Ready(states);
    if (connected && now - told >= kTold) {
      told = now;
      states.SetAlarms(alarms.Read());
      for (const Outgoing& message :
           states.Due(NowNs(), now, outlet->KnowsAll())) {
        published += outlet->Publish(message) ? 1U : 0U;
      }
    }
    duties.Tick([&] {
      return std::vector<Metric>{
          {"valves", "Valves that are told of.", states.valves()},
          {"published_total", "Messages that went out.", published},
          {"broker_connected", "1 while there is a connection.",
           connected ? 1U : 0U}};
    });
  }
  outlet->End(farewell);
  return report::kExitOk;
}

}  // namespace

void AddOutVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "out", "Findings of all monitors go to a broker, or are printed",
      RunOut);
  options.mqtt.AddTo(verb);
  verb.add_option("--lines", options.lines,
                  "Print the messages instead, one a line (docs/connect.md)")
      ->type_name("FILE|-");
  verb.add_option("--plant", options.plant,
                  "Table of the valves (docs/plant.md): its valves are told of "
                  "even if no monitor does, with their groups")
      ->type_name("FILE");
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
