#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "base/error.h"
#include "import/tag_map.h"
#include "programs/simulator/delivery.h"
#include "programs/simulator/recorded_feed.h"
#include "programs/simulator/verbs.h"
#include "report/help.h"
#include "simulator/second_look/valve_physics.h"
#include "simulator/valve_equations.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"

namespace fdi::simulator {
namespace {

constexpr const char* kStdinName = "-";

struct ReplayOptions {
  std::string file;
  std::string run;
  std::string valve;
  bool keep_stamps{false};
  importer::TableOptions table;
  StreamOptions stream;
  DeliveryOptions delivery;
};

// The samples to replay, and their valve.
struct Recording {
  std::string valve_id;
  StoredFeed::Parts parts;  // None is empty.
};

Recording LoadRun(const ReplayOptions& options,
                  const report::Context& context) {
  const storage::DataDirectory data{context.options.data_dir};
  if (!std::filesystem::exists(data.runs())) {
    throw NotFoundError("no run " + options.run + ": there is no " +
                        data.runs().string());
  }
  storage::RunStore store(data.runs());
  storage::StoredRun run = store.Load(options.run);
  Recording recording{std::move(run.info.run.valve_id), {}};
  if (!run.samples.empty()) {
    auto& samples = recording.parts.emplace_back();
    samples.reserve(run.samples.size());
    for (const storage::StoredSample& stored : run.samples) {
      samples.push_back({stored.sample, stored.truth});
    }
  }
  return recording;
}

// Of the valve's model set in the data directory, if any.
std::optional<FlowTarget> FlowTargetOf(const std::string& valve,
                                       const report::Context& context) {
  const storage::DataDirectory data{context.options.data_dir};
  if (!std::filesystem::exists(data.models())) {
    return std::nullopt;
  }
  storage::ModelStore store(data.models());
  const auto assigned = store.AssignedModelSet(valve);
  return assigned
             ? std::optional(simulator::FlowTargetOf(store.Load(*assigned)))
             : std::nullopt;
}

Recording LoadCsv(const ReplayOptions& options,
                  const report::Context& context) {
  importer::CsvTable table = importer::ReadCsvFile(
      options.file, {.map = options.stream.map,
                     .required = MaskOf(Signal::kCv),
                     .split_gaps = options.stream.split_gaps,
                     .log = context.log});
  Recording recording;
  const FlowUnit own = table.header.flow_unit;
  const FlowTarget to =
      FlowTargetOf(options.valve, context).value_or(FlowTarget{own});
  if ((table.header.signals & MaskOf(Signal::kF)) != 0) {
    ReportConversion(context.log, options.file, own, to.unit);
  }
  FlowConversion conversion(to);
  for (SampleSeries& run : table.runs) {
    for (LabelledSample& labelled : run.samples) {
      conversion.Apply(labelled.sample);
    }
    recording.parts.push_back(std::move(run.samples));
  }
  return recording;
}

void Check(const ReplayOptions& options) {
  if (options.file.empty() == options.run.empty()) {
    throw ConfigError("replay takes one of --file FILE|- and --run ID");
  }
  if (options.run.empty() && options.valve.empty()) {
    throw ConfigError("--valve ID is missing: whose samples are these?");
  }
  if (options.keep_stamps && !options.delivery.start.empty()) {
    throw ConfigError("--keep-stamps and --start exclude each other");
  }
  if (options.delivery.end_now &&
      (options.keep_stamps || options.file == kStdinName)) {
    throw ConfigError(
        "--end-now goes neither with --keep-stamps nor with --file -, whose "
        "end "
        "is not known");
  }
  if (options.file.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  StartOf(options.delivery, 0.0, 1.0);  // An invalid one is rejected first.
}

// Opens the feed; sets `valve_id` if the options do not.
std::unique_ptr<Feed> OpenFeed(const ReplayOptions& options, double speed,
                               Restamping restamping,
                               const report::Context& context,
                               report::StopSignals& signals,
                               std::string& valve_id) {
  if (options.file == kStdinName) {
    if (options.stream.map.resampling || options.stream.map.long_table) {
      throw ConfigError(
          "--file -: what is resampled or long is read as a whole; try a file");
    }
    StreamOptions stream = options.stream;
    stream.flow = FlowTargetOf(options.valve, context);
    return std::make_unique<StreamFeed>(STDIN_FILENO, signals, stream,
                                        restamping, context.log);
  }
  Recording recording = options.run.empty() ? LoadCsv(options, context)
                                            : LoadRun(options, context);
  if (valve_id.empty()) {
    valve_id = recording.valve_id;
  }
  if (!recording.parts.empty()) {
    restamping.start =
        [&options, speed,
         duration_s =
             1e-9 * static_cast<double>(
                        recording.parts.back().back().sample.stamp_ns -
                        recording.parts.front().front().sample.stamp_ns)] {
          return StartOf(options.delivery, duration_s, speed);
        };
  }
  return std::make_unique<StoredFeed>(std::move(recording.parts), restamping);
}

report::Report Replay(const ReplayOptions& given,
                      const report::Context& context) {
  ReplayOptions options = given;
  Check(options);
  options.stream.map = options.table.Read(context.options.utc);
  if (const auto target = FlowTargetOf(options.valve, context)) {
    importer::CheckGasFlow(options.stream.map, MolarMass(target->medium));
  }
  const bool at_once = options.file == kStdinName && !options.delivery.speed;
  const double speed =
      ParseSpeed(options.delivery.speed.value_or(at_once ? "max" : "1"));
  SamplePublisherOptions publishing =
      PublisherOptionsOf(options.delivery, speed);
  if (at_once) {
    // A gateway continues without readers; an existing one paces it.
    publishing.needs_reader = options.delivery.wait_reader_s > 0.0;
  }
  Restamping restamping;
  restamping.keep = options.keep_stamps;
  restamping.start = [&options, speed] {
    return StartOf(options.delivery, 0.0, speed);
  };
  restamping.source_id = NewSourceId();

  report::StopSignals signals;
  // Nothing is published before the whole file is read.
  signals.EndWithin(std::chrono::milliseconds(800),
                    "fdi-simulator: error: interrupted\n");
  FedValve valve{options.valve, restamping.source_id};
  const auto feed =
      OpenFeed(options, speed, restamping, context, signals, valve.valve_id);
  signals.EndWithin(std::chrono::milliseconds(0));
  RequireValveId(valve.valve_id);
  FeedSinks sinks;
  sinks.publisher = std::make_unique<SamplePublisher>(
      publishing, std::vector{valve.valve_id}, context, signals);
  sinks.publisher->AwaitReader();
  return Deliver(*feed, sinks, speed, signals, {valve});
}

}  // namespace

void AddReplayVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "replay",
      "Publish a stored run, a CSV file or what comes on stdin", Replay);
  verb.add_option("--file", options.file,
                  "CSV file; - reads CSV or JSON lines from stdin and passes "
                  "each on at once, unless --speed is given")
      ->type_name("FILE|-");
  options.table.AddTo(verb);
  verb.add_option("--run", options.run, "A stored run, or a stretch of it")
      ->type_name("ID[@from:to]");
  verb.add_option("--valve", options.valve,
                  "Valve id (default: that of the stored run)")
      ->type_name("ID");
  AddDeliveryOptions(verb, options.delivery);
  verb.add_flag("--keep-stamps", options.keep_stamps,
                "Keep the time stamps instead of beginning now; t_s of a CSV "
                "or of JSON is then Unix time");
  verb.add_flag("--split-gaps", options.stream.split_gaps,
                "Accept gaps in the times of a CSV or of JSON, and keep them");
  verb.add_option("--period", options.stream.period_s,
                  "Sample period of lines on stdin (default: their first "
                  "step; 1 s for JSON lines without t_s, which are stamped "
                  "on arrival)")
      ->check(CLI::Range(1e-3, 3600.0))
      ->default_str("")
      ->type_name("S");
  report::ShowInHelpAll(verb, {"--resample", "--wait-reader", "--keep-alive"});
}

}  // namespace fdi::simulator
