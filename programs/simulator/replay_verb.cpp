#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "import/csv.h"
#include "import/tag_map.h"
#include "programs/simulator/delivery.h"
#include "programs/simulator/verbs.h"
#include "report/help.h"
#include "simulator/second_look/valve_physics.h"
#include "simulator/valve_equations.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"

namespace fdi::simulator {
namespace {

struct ReplayOptions {
  std::string file;
  std::string run;
  std::string valve;
  bool keep_stamps{false};
  bool split_gaps{false};
  importer::TableOptions table;
  DeliveryOptions delivery;
};

using Parts = std::vector<std::vector<LabelledSample>>;

// The samples to replay, and their valve.
struct Recording {
  std::string valve_id;
  Parts parts;  // None is empty.
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

// From the valve's model set in the data directory, if any.
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
  const auto target = FlowTargetOf(options.valve, context);
  const importer::ColumnMap map = options.table.Read(context.options.utc);
  if (target) {
    importer::CheckGasFlow(map, MolarMass(target->medium));
  }
  importer::CsvTable table =
      importer::ReadCsvFile(options.file, {.map = map,
                                           .required = MaskOf(Signal::kCv),
                                           .split_gaps = options.split_gaps,
                                           .log = context.log});
  Recording recording;
  const FlowUnit own = table.header.flow_unit;
  const FlowTarget to = target.value_or(FlowTarget{own});
  if ((table.header.signals & MaskOf(Signal::kF)) != 0 && own != to.unit) {
    context.log(LogLevel::kInfo,
                EventLine("flow_converted",
                          {{"run", options.file},
                           {"from", std::string(FlowUnitName(own))},
                           {"to", std::string(FlowUnitName(to.unit))}}));
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
  if (options.file.empty() && options.table.given()) {
    throw ConfigError("--map, --zone and --resample are of --file");
  }
  StartOf(options.delivery, 0.0, 1.0);  // An invalid one is rejected first.
}

// Samples that are known in advance, shifted so that the first is stamped with
// `start_ns`, or unchanged without it.
class StoredFeed final : public Feed {
 public:
  StoredFeed(Parts parts, std::optional<std::int64_t> start_ns,
             std::uint64_t source_id)
      : parts_(std::move(parts)), source_id_(source_id) {
    if (start_ns && !parts_.empty()) {
      shift_ns_ = *start_ns - parts_.front().front().sample.stamp_ns;
    }
  }

  std::optional<FedSample> Next() override {
    while (part_ < parts_.size() && next_ == parts_[part_].size()) {
      parts_[part_++] = {};  // Freed behind its last sample.
      next_ = 0;
    }
    if (part_ == parts_.size()) {
      return std::nullopt;
    }
    FedSample fed{0, parts_[part_][next_++]};
    fed.labelled.sample.source_id = source_id_;
    fed.labelled.sample.stamp_ns += shift_ns_;
    return fed;
  }

 private:
  Parts parts_;
  std::uint64_t source_id_;
  std::int64_t shift_ns_{0};
  std::size_t part_{0};
  std::size_t next_{0};
};

double SecondsOf(const Parts& parts) {
  return parts.empty()
             ? 0.0
             : 1e-9 *
                   static_cast<double>(parts.back().back().sample.stamp_ns -
                                       parts.front().front().sample.stamp_ns);
}

report::Report Replay(const ReplayOptions& options,
                      const report::Context& context) {
  Check(options);
  const double speed = ParseSpeed(options.delivery.speed.value_or("1"));
  report::StopSignals signals;
  // Nothing is published before the whole file is read.
  signals.EndWithin(std::chrono::milliseconds(800),
                    "fdi-simulator: error: interrupted\n");
  Recording recording = options.run.empty() ? LoadCsv(options, context)
                                            : LoadRun(options, context);
  signals.EndWithin(std::chrono::milliseconds(0));
  FedValve valve{options.valve.empty() ? recording.valve_id : options.valve,
                 NewSourceId()};
  RequireValveId(valve.valve_id);
  FeedSinks sinks;
  sinks.publisher = std::make_unique<SamplePublisher>(
      PublisherOptionsOf(options.delivery, speed), std::vector{valve.valve_id},
      context, signals);
  sinks.publisher->AwaitReader();
  std::optional<std::int64_t> start_ns;
  if (!options.keep_stamps) {
    start_ns = StartOf(options.delivery, SecondsOf(recording.parts), speed);
  }
  StoredFeed feed(std::move(recording.parts), start_ns, valve.source_id);
  return Deliver(feed, sinks, speed, signals, {valve});
}

}  // namespace

void AddReplayVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "replay", "Publish a stored run or a CSV file", Replay);
  verb.add_option("--file", options.file, "CSV file; - is stdin")
      ->type_name("FILE|-");
  options.table.AddTo(verb);
  verb.add_option("--run", options.run, "A stored run, or a stretch of it")
      ->type_name("ID[@from:to]");
  verb.add_option("--valve", options.valve,
                  "Valve id (default: that of the stored run)")
      ->type_name("ID");
  AddDeliveryOptions(verb, options.delivery);
  verb.add_flag("--keep-stamps", options.keep_stamps,
                "Keep the time stamps instead of ending now; t_s of a CSV "
                "is then Unix time");
  verb.add_flag("--split-gaps", options.split_gaps,
                "Accept gaps in the times of a CSV, and keep them");
  report::ShowInHelpAll(verb, {"--resample", "--wait-reader", "--keep-alive"});
}

}  // namespace fdi::simulator
