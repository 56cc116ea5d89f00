// fdi-store runs: list, show, import, export, label, delete, plot.
#include "storage/runs/runs.h"

#include <random>

#include "base/error.h"
#include "base/printable.h"
#include "base/text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "import/csv.h"
#include "import/tag_map.h"
#include "programs/store/verbs.h"
#include "report/signal_list.h"
#include "report/text_table.h"

namespace fdi::storage {
namespace {

using report::Format;

Json LabelJson(const RunLabel& label) {
  return {{"fault", FaultName(label.fault)},
          {"strength", label.strength},
          {"from_s", label.from_s},
          {"to_s", NumberJson(label.to_s)}};
}

// A run as all verbs of the group show it.
Json RunJson(const RunInfo& info) {
  const NewRun& run = info.run;
  Json intake = Json::object();
  for (std::size_t i = 0; i < info.intake.size(); ++i) {
    intake[std::string(IntakeName(static_cast<Intake>(i)))] = info.intake[i];
  }
  return {{"run_id", info.id},
          {"valve_id", run.valve_id},
          {"source_id", Hex16(run.source_id)},
          {"origin", RunOriginName(run.origin)},
          {"state", RunStateName(info.state)},
          {"start_utc", TimeJson(run.start_ns)},
          {"created_utc", TimeJson(info.created_ns)},
          {"samples", info.samples},
          {"period_s", run.period_s},
          {"flow_unit", FlowUnitName(run.flow_unit)},
          {"signals", report::SignalsJson(info.signals)},
          {"has_truth", info.has_truth},
          {"labels", Rows(info.labels, LabelJson)},
          {"intake", intake},
          {"stored_bytes", info.stored_bytes},
          {"seed", run.seed ? Json(*run.seed) : Json()},
          {"software", run.software},
          {"scenario", run.scenario}};
}

struct ListOptions {
  std::string valve{"*"};
  std::string origin;
  report::TimeWindow window;
};

std::optional<RunOrigin> OriginOf(const std::string& name) {
  if (name.empty()) {
    return std::nullopt;
  }
  for (const RunOrigin origin :
       {RunOrigin::kSimulated, RunOrigin::kImported, RunOrigin::kRecorded}) {
    if (RunOriginName(origin) == name) {
      return origin;
    }
  }
  throw ConfigError("unknown origin '" + name +
                    "'; there are simulated, imported, recorded");
}

// "f19 0.50"; "f7 0.20, ..." for the last of several labels; "stored"; "-".
std::string TruthText(const Json& run) {
  const Json& labels = run["labels"];
  if (labels.empty()) {
    return run["has_truth"].get<bool>() ? "stored" : "-";
  }
  const Json& label = labels.back();
  std::string text = label["fault"];
  if (text != "normal") {
    text += " " + report::FormatNumber(label["strength"], 2);
  }
  return labels.size() > 1 ? text + ", ..." : text;
}

Report ListRuns(const ListOptions& options, const Context& context) {
  RunFilter filter;
  filter.valve_glob = options.valve;
  filter.origin = OriginOf(options.origin);
  filter.since_ns = options.window.since_ns(context);
  filter.until_ns = options.window.until_ns(context);
  Report report;
  report.document["runs"] =
      Rows(RunStore(DataOf(context).runs()).List(filter), RunJson);
  report.Table("runs", {{"run", "run_id"},
                        {"valve", "valve_id"},
                        {"start", "start_utc", Format::kTime},
                        {"samples", "samples"},
                        {"Ts [s]", "period_s", Format::kPlain, 3},
                        {"flow in", "flow_unit"},
                        {"origin", "origin"},
                        {"state", "state"},
                        TextColumn("truth", TruthText)});
  return report;
}

// "120 (118 accepted, 2 late)"
std::string SamplesText(const Json& run) {
  std::string intake;
  for (const auto& [name, count] : run["intake"].items()) {
    if (count != 0) {
      intake += (intake.empty() ? "" : ", ") + count.dump() + " " + name;
    }
  }
  return run["samples"].dump() + " (" + intake + ")";
}

std::string LabelText(const RunLabel& label) {
  return FaultName(label.fault) + " " +
         report::FormatNumber(label.strength, 2) + " for " +
         report::FormatNumber(label.from_s, 1) + " s <= t < " +
         (std::isfinite(label.to_s) ? report::FormatNumber(label.to_s, 1) + " s"
                                    : "end");
}

Report ShowRun(const std::string& id, const Context& context) {
  const RunInfo info = RunStore(DataOf(context).runs()).Info(id);
  Report report;
  report.document = RunJson(info);
  std::vector<report::Column> fields = {
      {"run", "run_id"},
      {"valve", "valve_id"},
      {"source", "source_id"},
      {"origin", "origin"},
      {"state", "state"},
      {"start", "start_utc", Format::kTime},
      TextColumn("samples", SamplesText),
      TextField("sample period",
                report::FormatNumber(info.run.period_s, 3) + " s"),
      {"signals", "signals"},
      {"flow in", "flow_unit"},
      TextField("truth", info.has_truth ? "stored beside every sample" : "-"),
      TextField("stored", std::to_string(info.stored_bytes) + " bytes"),
      {"seed", "seed"},
      {"software", "software"}};
  for (const RunLabel& label : info.labels) {
    fields.push_back(TextField("label", LabelText(label)));
  }
  report.Fields("", std::move(fields));
  if (!info.run.scenario.empty()) {
    report.Line("scenario:\n" + info.run.scenario);
  }
  return report;
}

struct RunImportOptions {
  std::string file;
  std::string valve;
  importer::TableOptions table;
  std::string start;
  std::string signals{"CV,P1,P2,T1,X,F"};
  double period_s{0.0};
  bool split_gaps{false};
  bool assume_normal{false};
};

// Each import is a source of its own: samples of two files are not one stream.
std::uint64_t RandomSource() {
  std::random_device device;
  return (std::uint64_t{device()} << 32U) | device();
}

// As on the bus, where a run may be replayed.
void CheckValve(const std::string& valve) {
  if (valve.empty() || valve.size() > kMaxIdLength || !IsPrintable(valve)) {
    throw ConfigError("--valve is '" + Printable(valve) +
                      "', accepted are 1 to 64 bytes without control "
                      "characters, in UTF-8");
  }
}

// The same file again would count twice in a training.
void WarnIfRepeated(const std::vector<RunInfo>& earlier, const RunInfo& stored,
                    const Context& context) {
  for (const RunInfo& run : earlier) {
    if (run.run.valve_id == stored.run.valve_id &&
        run.run.origin == RunOrigin::kImported &&
        run.run.start_ns == stored.run.start_ns &&
        run.samples == stored.samples) {
      context.log(LogLevel::kWarning,
                  "import_repeated run=" + stored.id + " same_as=" + run.id);
      return;
    }
  }
}

Report ImportRuns(const RunImportOptions& options, const Context& context) {
  CheckValve(options.valve);
  const std::int64_t start_ns =
      options.start.empty() ? NowNs() / kNsPerSecond * kNsPerSecond
                            : ParseTime(options.start, context.options.utc);
  const importer::CsvTable table = importer::ReadCsvFile(
      options.file, {.map = options.table.Read(context.options.utc),
                     .required = report::ParseSignals(options.signals),
                     .split_gaps = options.split_gaps,
                     .period_s = options.period_s,
                     .start_ns = start_ns,
                     .log = context.log});
  if (table.dated && !options.start.empty()) {
    throw ConfigError("--start: the times of " + options.file +
                      " have a date of their own");
  }
  if (options.assume_normal && table.header.has_truth) {
    throw ConfigError("--assume-normal: " + options.file +
                      " carries its own truth");
  }
  NewRun run;
  run.valve_id = options.valve;
  run.source_id = RandomSource();
  run.start_ns = table.start_ns;
  run.origin = RunOrigin::kImported;
  // The run records how it was made from the original file.
  run.scenario = options.file;
  for (const std::string& note : table.notes) {
    run.scenario += '\n' + note;
  }
  run.software = context.software;
  RunStore store(WritableDataOf(context).runs(), Access::kOccasionalWriter);
  const std::vector<RunInfo> earlier = store.List({});
  std::vector<RunInfo> stored;
  std::int64_t samples = 0;
  Report report;
  for (const std::string& id : store.Import(table.runs, run)) {
    if (options.assume_normal) {
      store.Label(id, 0, 0.0);
    }
    stored.push_back(store.Info(id));
    WarnIfRepeated(earlier, stored.back(), context);
    samples += stored.back().samples;
    report.Line("run " + id + ": " + std::to_string(stored.back().samples) +
                " samples of " + options.valve);
  }
  // The first run's keys go to the top level, as there is usually only one run.
  report.document = RunJson(stored.front());
  report.document["samples"] = samples;
  report.document["ignored_columns"] = table.header.ignored_columns;
  report.document["notes"] = table.notes;
  report.document["runs"] = Rows(stored, RunJson);
  return report;
}

struct FileOptions {
  std::string selector;
  std::string output;
  bool stamps{false};
};

// Leaves out samples that the intake rejected, because late and repeated ones
// would make a file that cannot be imported.
int ExportRun(const FileOptions& options, const Context& context) {
  const StoredRun run = RunStore(DataOf(context).runs()).Load(options.selector);
  std::vector<LabelledSample> samples;
  for (const StoredSample& stored : run.samples) {
    if (stored.intake == Intake::kAccepted) {
      samples.push_back({stored.sample, stored.truth});
    }
  }
  report::WriteOutput(options.output, [&](std::ostream& out) {
    importer::WriteCsv(out, samples, run.info.run.flow_unit,
                       run.info.run.start_ns, options.stamps);
  });
  if (const std::size_t left_out = run.samples.size() - samples.size()) {
    context.log(LogLevel::kWarning,
                "export_left_out rejected_samples=" + std::to_string(left_out));
  }
  return report::kExitOk;
}

struct RunLabelOptions {
  std::string run;
  std::string fault;
  double strength{1.0};
  bool remove{false};
};

Report LabelRun(const RunLabelOptions& options, const Context& context) {
  RunStore store(DataOf(context).runs(), Access::kOccasionalWriter);
  Report report;
  if (options.remove) {
    report.Line(std::to_string(store.RemoveLabels(options.run)) +
                " labels removed");
  } else {
    if (options.fault.empty()) {
      throw ConfigError("FAULT is needed: normal or " +
                        std::string(kFaultNames) + ", or --remove");
    }
    const int fault =
        options.fault == "normal" ? 0 : RequireFault(options.fault);
    store.Label(options.run, fault, fault == 0 ? 0.0 : options.strength);
    report.Line(store.Info(options.run).id + " labelled " + FaultName(fault));
  }
  report.document = RunJson(store.Info(options.run));
  return report;
}

Report Delete(const std::vector<std::string>& ids, const Context& context) {
  RunStore store(DataOf(context).runs(), Access::kOccasionalWriter);
  Report report;
  report.document["deleted"] = Json::array();
  for (const std::string& id : ids) {
    const std::string full = store.Delete(id);
    report.document["deleted"].push_back(full);
    report.Line(full + " deleted");
  }
  return report;
}

void AddImport(report::Program& program, CLI::App& group) {
  auto [verb, options] =
      AddVerb(program, group, "import",
              "Store a CSV file as a run; all of it or nothing", ImportRuns);
  verb.add_option("file", options.file, "CSV file, or - for stdin")->required();
  verb.add_option("--valve", options.valve, "Id of the valve")
      ->required()
      ->type_name("ID");
  options.table.AddTo(verb);
  verb.add_option("--start", options.start,
                  "Time of t = 0, if times have no date (default: now)");
  verb.add_option("--signals", options.signals,
                  "Signals that must be there, where no --map names them");
  verb.add_option("--period", options.period_s,
                  "Sample period in s (0: the most usual step)")
      ->check(CLI::NonNegativeNumber);
  verb.add_flag("--split-gaps", options.split_gaps,
                "Let a gap start a new run instead of refusing it");
  verb.add_flag("--assume-normal", options.assume_normal,
                "Label the run as free of faults");
}

}  // namespace

void AddRunsVerbs(report::Program& program) {
  constexpr const char* kSelector = "ID or last, or ID@from:to in s";
  CLI::App& group = program.AddGroup("runs", "Stored runs");
  auto [list, list_options] =
      AddVerb(program, group, "list", "List the runs", ListRuns);
  list.add_option("--valve", list_options.valve, "Glob over valve ids")
      ->type_name("GLOB");
  list.add_option("--origin", list_options.origin,
                  "simulated, imported or recorded");
  list_options.window.AddTo(list);

  auto [show, id] = AddVerb(program, group, "show", "Show one run", ShowRun);
  show.add_option("run", id, "ID or a unique beginning of it")->required();

  AddSniffVerb(program, group);
  AddImport(program, group);

  auto [exporting, exported] =
      AddVerb(program, group, "export",
              "Write a run, or a stretch of it, as CSV", ExportRun);
  exporting.add_option("run", exported.selector, kSelector)->required();
  AddOutput(exporting, exported.output);
  exporting.add_flag("--stamps", exported.stamps,
                     "Also write stamp_ns, which is exact, and utc");

  auto [label, label_options] =
      AddVerb(program, group, "label",
              "Note which fault, if any, a run or a stretch of it really had",
              LabelRun);
  label.add_option("run", label_options.run, kSelector)->required();
  label.add_option("fault", label_options.fault,
                   "normal or " + std::string(kFaultNames));
  label
      .add_option("--strength", label_options.strength,
                  "Strength of the fault [-]")
      ->check(CLI::Range(-1.0, 1.0));
  label.add_flag("--remove", label_options.remove,
                 "Remove all labels of the run");

  auto [remove, ids] = AddVerb(program, group, "delete", "Delete runs", Delete);
  remove.add_option("run", ids, "IDs")->required();
}

}  // namespace fdi::storage
