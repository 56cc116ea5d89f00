#include <cstdio>
#include <memory>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/time_units.h"
#include "bench/study/fault_injection.h"
#include "bench/study/verbs.h"
#include "import/csv.h"
#include "import/tag_map.h"
#include "report/help.h"
#include "report/output_folder.h"
#include "report/program.h"
#include "report/report.h"
#include "simulator/scenario/scenario_toml.h"
#include "storage/database/data_directory.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/file_runs.h"

namespace fdi::trainer::study {
namespace {

struct InjectOptions {
  std::string run;
  std::string file;
  importer::TableOptions table;
  std::vector<std::string> faults;
  std::string parameters{"lublin-actuator-3"};
  std::string flow_range;
  std::filesystem::path output;
  std::string valve;
  bool store{false};
};

SignalRange ParseRange(const std::string& text) {
  SignalRange range{};
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf:%lf%n", &range.minimum, &range.maximum,
                  &used) == 2 &&
      text.c_str()[used] == '\0' && range.minimum < range.maximum) {
    return range;
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
  return injection;
}

storage::StoredRun LoadRun(const InjectOptions& options, SignalMask signals,
                           const report::Context& context) {
  if (options.run.empty() == options.file.empty()) {
    throw ConfigError(
        "choose the record to put the fault onto: --run ID or --file FILE.csv");
  }
  if (!options.run.empty()) {
    const storage::DataDirectory directory{context.options.data_dir};
    return storage::RunStore(directory.runs()).Load(options.run);
  }
  return ReadRunFile(options.file,
                     {.map = options.table.Read(context.options.utc),
                      .required = signals,
                      .log = context.log});
}

// Returns the id of the new run.
std::string Store(const InjectedRun& injected, const InjectOptions& options,
                  const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::NewRun row = injected.run.info.run;
  row.valve_id = options.valve.empty() ? row.valve_id : options.valve;
  // A file whose times have no date becomes a record that starts now.
  const std::int64_t shift =
      row.start_ns != 0 ? 0 : NowNs() / kNsPerSecond * kNsPerSecond;
  row.start_ns = injected.run.samples.front().sample.stamp_ns + shift;
  row.origin = storage::RunOrigin::kImported;
  row.scenario = injected.source + " with " + JoinText(injected.faults);
  row.software = context.software;
  storage::EnsureExists(directory);
  storage::RunRecorder recorder(directory.runs());
  const auto key = recorder.Begin(row);
  std::string id = recorder.Id(key);
  for (storage::StoredSample stored : injected.run.samples) {
    stored.sample.stamp_ns += shift;
    recorder.Append(key, stored);
  }
  recorder.End(key);
  recorder.Close();
  return id;
}

void Write(const InjectedRun& injected, const std::filesystem::path& path) {
  std::vector<LabelledSample> samples;
  for (const storage::StoredSample& stored : injected.run.samples) {
    if (stored.intake == Intake::kAccepted) {
      samples.push_back({stored.sample, stored.truth});
    }
  }
  report::WriteOutput(path, [&](std::ostream& out) {
    importer::WriteCsv(out, samples, injected.run.info.run.flow_unit,
                       injected.run.samples.front().sample.stamp_ns);
  });
}

report::Report ReportOf(const InjectedRun& injected, const std::string& id,
                        const std::string& file) {
  report::Report report;
  report.document = {
      {"run_id", id.empty() ? report::Json() : report::Json(id)},
      {"file", file.empty() ? report::Json() : report::Json(file)},
      {"source", injected.source},
      {"samples", injected.run.samples.size()},
      {"faults", injected.faults},
      {"faulty_samples", injected.faulty},
      {"samples_at_flow_limit", injected.at_limit},
      {"left_out", injected.left_out}};
  report.Line((id.empty() ? file : "run " + id) + ": " +
              JoinText(injected.faults) + " on " +
              std::to_string(injected.faulty) + " of " +
              std::to_string(injected.run.samples.size()) + " samples of " +
              injected.source);
  for (const std::string& what : injected.left_out) {
    report.Line("left out: " + what);
  }
  if (injected.at_limit > 0) {
    report.Line("the flow reads a limit of its transmitter in " +
                std::to_string(injected.at_limit) +
                " of the samples with a fault");
  }
  return report;
}

report::Report Inject(const InjectOptions& options,
                      const report::Context& context) {
  const FaultInjection injection = InjectionOf(options);
  const bool store = options.output.empty() || options.store;
  if (store && !options.file.empty() && options.valve.empty()) {
    throw ConfigError("a stored run belongs to a valve: --valve ID");
  }
  if (options.file.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  const InjectedRun injected =
      InjectInto(LoadRun(options, SignalsFor(injection), context), injection,
                 !options.flow_range.empty());
  if (!options.output.empty()) {
    Write(injected, options.output);
  }
  return ReportOf(injected,
                  store ? Store(injected, options, context) : std::string(),
                  options.output.string());
}

void AddOptions(CLI::App& verb, InjectOptions& options) {
  CLI::Option* run = verb.add_option("--run", options.run,
                                     "A healthy run, or a stretch of it [s]")
                         ->type_name("ID[@from:to]");
  verb.add_option("--file", options.file,
                  "A healthy record in a CSV file, or a stretch of it [s]")
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
                  "Parameters with the flow equation and the ranges of the "
                  "transmitters")
      ->type_name("NAME|FILE.toml");
  verb.add_option("--flow-range", options.flow_range,
                  "Range of the flow transmitter in the unit of the run "
                  "(default: that of the parameters)")
      ->type_name("LOW:HIGH");
  options.table.AddTo(verb);
  verb.add_option("-o,--output", options.output,
                  "Write the result to this file instead of storing it")
      ->type_name("FILE.csv");
  verb.add_flag("--store", options.store,
                "Store the result as well as writing it to --output");
  verb.add_option("--valve", options.valve,
                  "Valve of the stored run (default: that of --run)")
      ->type_name("ID");
}

}  // namespace

void AddInjectVerb(report::Program& program) {
  auto options = std::make_shared<InjectOptions>();
  CLI::App& verb = program.AddVerb(
      "inject",
      "Put a fault exactly onto a recorded healthy run: f5 f6 f7 f18 f19 t1 "
      "p1 p2",
      [options](const report::Context& context) -> report::Report {
        return Inject(*options, context);
      });
  AddOptions(verb, *options);
  program.AddExamples(
      {{"inject",
        {{"What a worn seat would have looked like in this record",
          "fdi-study inject --run 1a2b --fault f6:abrupt@600:strength=0.5 "
          "-o f6.csv"},
         {"On a file of the plant",
          "fdi-study inject --file day.csv --fault "
          "f19:incipient@300+600:strength=0.4 -o f19.csv"}}}});
}

}  // namespace fdi::trainer::study
