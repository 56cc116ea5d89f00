#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "programs/simulator/delivery.h"
#include "programs/simulator/verbs.h"
#include "report/help.h"
#include "report/text_table.h"
#include "simulator/scenario/scenario_toml.h"

namespace fdi::simulator {
namespace {

// A scenario in TOML has signed integers.
constexpr std::uint64_t kMaxSeed = std::numeric_limits<std::int64_t>::max();

struct RunOptions {
  std::string valve;
  std::filesystem::path scenario;
  std::string parameters;
  std::string excitation;
  std::vector<std::string> faults;
  std::vector<std::string> settings;
  std::optional<double> duration_s;
  std::optional<std::uint64_t> seed;
  int count{1};
  bool record{false};
  bool no_publish{false};
  std::filesystem::path export_file;
  DeliveryOptions delivery;
};

// A fault that never begins is a slip: the run would be called healthy.
void RequireFaultsWithin(const ValveSimulationConfig& config) {
  for (const FaultSchedule& fault : config.faults) {
    if (fault.start_s >= config.duration_s) {
      throw ConfigError("fault " + ToText(fault) +
                        " begins after the end of the run (--duration " +
                        report::FormatNumber(config.duration_s, 0) + ")");
    }
  }
}

// Applies the scenario file, then the options, then --set.
Scenario BaseScenario(const RunOptions& options, double speed) {
  Scenario scenario;
  ValveSimulationConfig& config = scenario.config;
  if (!options.scenario.empty()) {
    ApplyScenarioFile(options.scenario, scenario);
  }
  if (!options.valve.empty()) {
    scenario.valve_id = options.valve;
  }
  if (!options.parameters.empty()) {
    config.parameters = FindParameters(options.parameters);
  }
  if (!options.excitation.empty()) {
    ChooseExcitation(options.excitation, {}, scenario);
  }
  if (!options.faults.empty()) {
    config.faults.clear();
    for (const std::string& text : options.faults) {
      config.faults.push_back(ParseFaultSchedule(text));
    }
  }
  config.duration_s = options.duration_s.value_or(config.duration_s);
  config.seed = options.seed.value_or(config.seed);
  for (const std::string& setting : options.settings) {
    ApplySetting(setting, scenario);
  }
  RequireFaultsWithin(config);
  if (config.start_ns == 0 || !options.delivery.start.empty()) {
    config.start_ns = StartOf(options.delivery, config.duration_s, speed);
  }
  return scenario;
}

// "VALVE-0001", ... or "ID-1", ...
std::string ValveIdOf(const std::string& base, int index) {
  if (base != Scenario{}.valve_id) {
    return base + '-' + std::to_string(index + 1);
  }
  char text[32];
  std::snprintf(text, sizeof text, "VALVE-%04d", index + 1);
  return text;
}

// One scenario per valve, each with its own seed and source.
std::vector<Scenario> Scenarios(const RunOptions& options, double speed) {
  if (!options.export_file.empty() && options.count > 1) {
    throw ConfigError("--output takes one valve, not " +
                      std::to_string(options.count));
  }
  const Scenario base = BaseScenario(options, speed);
  const auto others = static_cast<std::uint64_t>(options.count) - 1;
  if (base.config.seed > kMaxSeed - others) {
    throw ConfigError("--count " + std::to_string(options.count) +
                      ": seeds that count up from " +
                      std::to_string(base.config.seed) + " exceed " +
                      std::to_string(kMaxSeed));
  }
  std::vector<Scenario> scenarios(static_cast<std::size_t>(options.count),
                                  base);
  for (int i = 0; i < options.count; ++i) {
    Scenario& scenario = scenarios[static_cast<std::size_t>(i)];
    if (options.count > 1) {
      scenario.valve_id = ValveIdOf(base.valve_id, i);
    }
    scenario.config.seed += static_cast<std::uint64_t>(i);
    scenario.config.source_id = NewSourceId();
    RequireValveId(scenario.valve_id);
  }
  return scenarios;
}

// Steps all valves in turn, so that samples are delivered in order of time.
class SimulationFeed final : public Feed {
 public:
  SimulationFeed(const std::vector<Scenario>& scenarios,
                 report::StopSignals& signals)
      : signals_(signals) {
    simulations_.reserve(scenarios.size());
    for (const Scenario& scenario : scenarios) {
      simulations_.emplace_back(scenario.config);
    }
  }

  std::optional<FedSample> Next() override {
    if (simulations_[valve_].finished() || signals_.stop_requested()) {
      return std::nullopt;
    }
    FedSample fed{valve_, simulations_[valve_].Step()};
    valve_ = (valve_ + 1) % simulations_.size();
    return fed;
  }

 private:
  report::StopSignals& signals_;
  std::vector<ValveSimulation> simulations_;
  std::size_t valve_{0};
};

storage::NewRun NewRunOf(const Scenario& scenario,
                         const std::string& software) {
  const ValveSimulationConfig& config = scenario.config;
  storage::NewRun run;
  run.valve_id = scenario.valve_id;
  run.source_id = config.source_id;
  run.start_ns = config.start_ns;
  run.period_s = config.period_s;
  run.flow_unit = config.parameters.instruments.flow_unit;
  run.origin = storage::RunOrigin::kSimulated;
  run.scenario = ScenarioText(scenario);
  run.seed = config.seed;
  run.software = software;
  return run;
}

report::Report Run(const RunOptions& options, const report::Context& context) {
  const double speed = options.no_publish
                           ? ParseSpeed("max")
                           : ParseSpeed(options.delivery.speed.value_or("1"));
  const std::vector<Scenario> scenarios = Scenarios(options, speed);
  report::StopSignals signals;
  SimulationFeed feed(scenarios, signals);
  std::vector<FedValve> valves;
  std::vector<std::string> ids;
  for (const Scenario& scenario : scenarios) {
    valves.push_back(
        {scenario.valve_id, scenario.config.source_id, scenario.config.seed});
    ids.push_back(scenario.valve_id);
  }

  // The files are opened before waiting for a reader, so that errors show at
  // once; the runs begin afterwards.
  FeedSinks sinks;
  if (!options.export_file.empty()) {
    sinks.csv = std::make_unique<CsvSink>(options.export_file);
  }
  if (options.record) {
    sinks.runs = std::make_unique<RunSink>(
        storage::DataDirectory{context.options.data_dir});
  }
  if (!options.no_publish) {
    sinks.publisher = std::make_unique<SamplePublisher>(
        PublisherOptionsOf(options.delivery, speed), std::move(ids), context,
        signals);
    sinks.publisher->AwaitReader();
  }
  for (std::size_t i = 0; sinks.runs && i < scenarios.size(); ++i) {
    valves[i].run_id =
        sinks.runs->Begin(NewRunOf(scenarios[i], context.software));
  }
  return Deliver(feed, sinks, speed, signals, std::move(valves));
}

// A plain number, or a duration such as "10m".
double SecondsOf(const std::string& text) {
  if (const auto seconds = ParseWhole<double>(text)) {
    return *seconds;
  }
  try {
    return static_cast<double>(ParseDuration(text)) / 1e9;
  } catch (const ConfigError& wrong) {
    throw ConfigError(std::string("--duration: ") + wrong.what());
  }
}

void AddScenarioOptions(CLI::App& verb, RunOptions& options) {
  verb.add_option("--valve", options.valve, "Valve id (default: VALVE-0001)")
      ->type_name("ID");
  verb.add_option("--scenario", options.scenario,
                  "Scenario file; the options below override it")
      ->type_name("FILE.toml");
  verb.add_option_function<std::string>(
          "--duration",
          [&options](const std::string& text) {
            options.duration_s = SecondsOf(text);
          },
          "Simulated time: seconds, 10m, 1h30m (default: 2000 s, or the "
          "excitation's)")
      ->type_name("S|TIME");
  verb.add_option("--fault", options.faults,
                  std::string(kFaultForms) + "; may be repeated")
      ->type_name("SPEC")
      ->default_str("")
      ->allow_extra_args(false);
  verb.add_option("--parameters", options.parameters,
                  "The valve (default: lublin-actuator-3)")
      ->type_name(
          "lublin-actuator-3|lublin-actuator-3-refit|paper-operating-point|"
          "FILE.toml");
  verb.add_option("--excitation", options.excitation,
                  "What moves it (default: operating-point)")
      ->type_name("operating-point|sine|level-loop|inventory-loop|csv:FILE");
  verb.add_option(
          "--set", options.settings,
          "A scenario key, e.g. excitation.amplitude_pct=5, "
          "noise=false, cold_start=true, parameters.trim.kv_m3_h=72; may be "
          "repeated")
      ->type_name("KEY=VALUE")
      ->default_str("")
      ->allow_extra_args(false);
  verb.add_option("--seed", options.seed, "Seed (default: 1)")
      ->check(CLI::Range(std::uint64_t{0}, kMaxSeed))
      ->type_name("N");
  verb.add_option("--count", options.count,
                  "Number of valves, named ID-1, ID-2, ...; their seeds "
                  "count up from --seed")
      ->check(CLI::Range(1, 100'000))
      ->type_name("N");
}

}  // namespace

void AddRunVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "run", "Simulate valves and publish their samples", Run);
  AddScenarioOptions(verb, options);
  AddDeliveryOptions(verb, options.delivery);
  verb.add_flag("--record", options.record,
                "Store the runs, with their truth, in runs.db");
  verb.add_flag("--no-publish", options.no_publish,
                "Simulate only, as fast as possible");
  verb.add_option("-o,--output", options.export_file, "Write the run as CSV")
      ->type_name("FILE.csv");
  report::ShowInHelpAll(
      verb, {"--start", "--wait-reader", "--keep-alive", "--output"});
}

}  // namespace fdi::simulator
