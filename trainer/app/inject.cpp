#include <iostream>
#include <memory>
#include <sstream>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "simulator/app/scenario_toml.h"
#include "storage/cli/json_output.h"
#include "storage/cli/output_folder.h"
#include "storage/cli/program.h"
#include "storage/cli/tag_map.h"
#include "storage/cli/time_text.h"
#include "storage/csv.h"
#include "storage/data_directory.h"
#include "storage/runs.h"
#include "trainer/app/file_runs.h"
#include "trainer/app/injected_run.h"
#include "trainer/app/verbs.h"

namespace fdi::trainer {
namespace {

struct InjectOptions {
  std::string run;
  std::string file;
  std::filesystem::path map;
  std::vector<std::string> faults;
  std::string parameters{"lublin-actuator-3"};
  std::string flow_range;
  std::filesystem::path output;
  std::string valve;
  bool store{false};
};

SignalRange ParseRange(const std::string& text) {
  try {
    std::size_t used = 0;
    const double low = std::stod(text, &used);
    const std::string rest = text.substr(used);
    const double high = std::stod(rest.substr(1), &used);
    if (rest.front() == ':' && used + 1 == rest.size() && low < high) {
      return {low, high};
    }
  } catch (const std::logic_error&) {
  }
  throw ConfigError("--flow-range " + text +
                    ": expected LOW:HIGH in the unit of the flow, LOW < HIGH");
}

FaultInjection InjectionOf(const InjectOptions& options) {
  FaultInjection injection;
  for (const std::string& text : options.faults) {
    injection.faults.push_back(simulator::ParseFaultSchedule(text));
    simulator::Validate(injection.faults.back());
  }
  injection.valve = simulator::FindParameters(options.parameters);
  if (!options.flow_range.empty()) {
    const SignalRange range = ParseRange(options.flow_range);
    injection.valve.instruments.flow.low = range.minimum;
    injection.valve.instruments.flow.high = range.maximum;
  }
  SignalsFor(injection);
  return injection;
}

storage::StoredRun LoadRun(const InjectOptions& options,
                           const FaultInjection& injection,
                           const storage::DataDirectory& directory) {
  if (options.run.empty() == options.file.empty()) {
    throw ConfigError(
        "what to put the fault onto: --run ID or --file FILE.csv");
  }
  if (!options.run.empty()) {
    return storage::RunStore(directory.runs()).Load(options.run);
  }
  std::optional<storage::ColumnMap> map;
  if (!options.map.empty()) {
    map = cli::ReadTagMap(options.map);
  }
  return ReadRunFile(options.file, map, SignalsFor(injection));
}

std::string Joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) {
    text += (text.empty() ? "" : ", ") + part;
  }
  return text;
}

// Returns the id of the new run.
std::string Store(const InjectedRun& injected, const InjectOptions& options,
                  const cli::Context& context) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const storage::DataDirectory directory{context.options.data_dir};
  storage::NewRun row = injected.run.info.run;
  row.valve_id = options.valve.empty() ? row.valve_id : options.valve;
  if (row.valve_id.empty()) {
    throw ConfigError("a stored run belongs to a valve: --valve ID");
  }
  // The time of a file has no date.
  const std::int64_t shift =
      options.file.empty() ? 0 : cli::NowNs() / kSecond * kSecond;
  row.start_ns = StartOf(injected.run) + shift;
  row.origin = storage::RunOrigin::kImported;
  row.scenario = injected.source + " with " + Joined(injected.faults);
  row.software = context.software;
  storage::EnsureExists(directory);
  storage::RunRecorder recorder(directory.runs());
  const auto key = recorder.Begin(row);
  for (storage::StoredSample stored : injected.run.samples) {
    stored.sample.stamp_ns += shift;
    recorder.Append(key, stored);
  }
  recorder.End(key);
  recorder.Close();
  return recorder.Id(key);
}

void Write(const InjectedRun& injected, const std::filesystem::path& path) {
  std::vector<LabelledSample> samples;
  for (const storage::StoredSample& stored : injected.run.samples) {
    if (stored.intake == Intake::kAccepted) {
      samples.push_back({stored.sample, stored.truth});
    }
  }
  std::ostringstream text;
  storage::WriteCsv(text, samples, injected.run.info.run.flow_unit,
                    StartOf(injected.run));
  cli::WriteFile(path, text.str());
}

void Print(std::ostream& out, const InjectedRun& injected,
           const std::string& id, const std::filesystem::path& file) {
  if (!id.empty()) {
    out << "run " << id << ": ";
  } else {
    out << file.string() << ": ";
  }
  out << Joined(injected.faults) << " on " << injected.faulty << " of "
      << injected.run.samples.size() << " samples of " << injected.source
      << '\n';
  for (const std::string& what : injected.left_out) {
    out << "left out: " << what << '\n';
  }
  if (injected.at_limit > 0) {
    out << "the flow reads a limit of its transmitter in " << injected.at_limit
        << " of the samples with a fault\n";
  }
}

int Inject(const InjectOptions& options, const cli::Context& context) {
  const FaultInjection injection = InjectionOf(options);
  const storage::DataDirectory directory{context.options.data_dir};
  const InjectedRun injected =
      InjectInto(LoadRun(options, injection, directory), injection,
                 !options.flow_range.empty());
  if (!options.output.empty()) {
    Write(injected, options.output);
  }
  const std::string id = options.output.empty() || options.store
                             ? Store(injected, options, context)
                             : std::string();
  if (!context.options.json) {
    Print(std::cout, injected, id, options.output);
    return cli::kExitOk;
  }
  cli::Json json;
  json["run_id"] = id.empty() ? cli::Json() : cli::Json(id);
  json["file"] =
      options.output.empty() ? cli::Json() : cli::Json(options.output.string());
  json["source"] = injected.source;
  json["samples"] = injected.run.samples.size();
  json["faults"] = injected.faults;
  json["faulty_samples"] = injected.faulty;
  json["samples_at_flow_limit"] = injected.at_limit;
  json["left_out"] = injected.left_out;
  cli::PrintJson(std::cout, json);
  return cli::kExitOk;
}

void AddOptions(CLI::App& verb, InjectOptions& options) {
  CLI::Option* run = verb.add_option("--run", options.run, "A healthy run [s]")
                         ->type_name("ID[@from:to]");
  CLI::Option* file = verb.add_option("--file", options.file,
                                      "A healthy record in a CSV file [s]")
                          ->excludes(run)
                          ->type_name("FILE.csv[@from:to]");
  verb.add_option("--fault", options.faults,
                  "Times in s from the first sample; repeatable: " +
                      std::string(simulator::kFaultForms))
      ->expected(1)
      ->take_all()
      ->required()
      ->type_name("FAULT");
  verb.add_option("--parameters", options.parameters,
                  "Flow equation and ranges of transmitters: a name or "
                  "FILE.toml")
      ->type_name("NAME");
  verb.add_option("--flow-range", options.flow_range,
                  "What the flow transmitter reads, in the unit of the run "
                  "(default: the parameters')")
      ->type_name("LOW:HIGH");
  verb.add_option("--map", options.map,
                  "TOML file: names, units, scale, offset, sense of columns")
      ->type_name("FILE.toml")
      ->needs(file);
  verb.add_option("-o,--output", options.output,
                  "Write the result there instead of storing it")
      ->type_name("FILE.csv");
  verb.add_flag("--store", options.store, "Store it beside --output too");
  verb.add_option("--valve", options.valve,
                  "Of the stored run (default: that of --run)")
      ->type_name("ID");
}

}  // namespace

void AddInjectVerb(cli::Program& program) {
  auto options = std::make_shared<InjectOptions>();
  CLI::App& verb = program.AddVerb(
      "inject",
      "Put a fault exactly onto a recorded healthy run: f5 f6 f7 f18 f19 t1 "
      "p1 p2",
      [options](const cli::Context& context) {
        return Inject(*options, context);
      });
  AddOptions(verb, *options);
}

}  // namespace fdi::trainer
