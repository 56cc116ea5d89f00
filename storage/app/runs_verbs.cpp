#include <cmath>
#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/app/common.h"
#include "storage/app/runs_json.h"
#include "storage/app/verbs.h"
#include "storage/cli/signal_list.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

std::string TruthText(const RunInfo& info) {
  if (info.labels.empty()) {
    return info.has_truth ? "stored" : "-";
  }
  const RunLabel& label = info.labels.back();
  std::string text = FaultName(label.fault);
  if (label.fault != 0) {
    text += " " + cli::FormatNumber(label.strength, 2);
  }
  return info.labels.size() > 1 ? text + ", ..." : text;
}

Json RunLabelJson(const RunLabel& label) {
  return {{"fault", FaultName(label.fault)},
          {"strength", label.strength},
          {"from_s", label.from_s},
          {"to_s", label.to_s}};
}

struct ListOptions {
  std::string valve{"*"};
  std::string origin;
  TimeWindow window;
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

int List(const ListOptions& options, const Context& context) {
  RunFilter filter;
  filter.valve_glob = options.valve;
  filter.origin = OriginOf(options.origin);
  filter.since_ns = options.window.since_ns(context);
  filter.until_ns = options.window.until_ns(context);
  const auto runs = RunStore(DataOf(context).runs()).List(filter);
  if (context.options.json) {
    Json list = Json::array();
    for (const RunInfo& run : runs) {
      list.push_back(RunJson(run));
    }
    cli::PrintJson(std::cout, {{"runs", list}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"run"},
                        {"valve"},
                        {"start"},
                        {"samples", Align::kRight},
                        {"Ts [s]", Align::kRight},
                        {"flow in"},
                        {"origin"},
                        {"state"},
                        {"truth"}});
  for (const RunInfo& run : runs) {
    table.AddRow({run.id, run.run.valve_id, TimeText(run.run.start_ns, context),
                  std::to_string(run.samples),
                  cli::FormatNumber(run.run.period_s, 3),
                  std::string(FlowUnitName(run.run.flow_unit)),
                  std::string(RunOriginName(run.run.origin)),
                  std::string(RunStateName(run.state)), TruthText(run)});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

int Show(const std::string& id, const Context& context) {
  const RunInfo info = RunStore(DataOf(context).runs()).Info(id);
  if (context.options.json) {
    cli::PrintJson(std::cout, RunJson(info));
    return cli::kExitOk;
  }
  const NewRun& run = info.run;
  std::string intake;
  for (std::size_t i = 0; i < info.intake.size(); ++i) {
    if (info.intake[i] > 0) {
      intake += (intake.empty() ? "" : ", ") + std::to_string(info.intake[i]) +
                " " + std::string(IntakeName(static_cast<Intake>(i)));
    }
  }
  std::vector<std::pair<std::string, std::string>> fields = {
      {"run", info.id},
      {"valve", run.valve_id},
      {"source", Hex(run.source_id)},
      {"origin", std::string(RunOriginName(run.origin))},
      {"state", std::string(RunStateName(info.state))},
      {"start", TimeText(run.start_ns, context)},
      {"samples", std::to_string(info.samples) + " (" + intake + ")"},
      {"sample period", cli::FormatNumber(run.period_s, 3) + " s"},
      {"signals", cli::SignalsText(info.signals)},
      {"flow in", std::string(FlowUnitName(run.flow_unit))},
      {"truth", info.has_truth ? "stored beside every sample" : "-"},
      {"stored", std::to_string(info.stored_bytes) + " bytes"},
      {"seed", run.seed ? std::to_string(*run.seed) : "-"},
      {"software", run.software}};
  for (const RunLabel& label : info.labels) {
    fields.emplace_back(
        "label",
        FaultName(label.fault) + " " + cli::FormatNumber(label.strength, 2) +
            " for " + cli::FormatNumber(label.from_s, 1) + " s <= t < " +
            (std::isfinite(label.to_s) ? cli::FormatNumber(label.to_s, 1) + " s"
                                       : "end"));
  }
  PrintFields(std::cout, fields);
  if (!run.scenario.empty()) {
    std::cout << "scenario:\n" << run.scenario << '\n';
  }
  return cli::kExitOk;
}

int Export(const std::string& selector, const std::string& output,
           const Context& context) {
  const StoredRun run = RunStore(DataOf(context).runs()).Load(selector);
  std::vector<LabelledSample> samples;
  std::int64_t left_out = 0;
  for (const StoredSample& stored : run.samples) {
    if (stored.intake == Intake::kAccepted) {
      samples.push_back({stored.sample, stored.truth});
    } else {
      ++left_out;
    }
  }
  WriteOutput(output, [&](std::ostream& out) {
    WriteCsv(out, samples, run.info.run.flow_unit, run.info.run.start_ns);
  });
  if (left_out > 0) {
    context.log(LogLevel::kWarning,
                "export_left_out rejected_samples=" + std::to_string(left_out));
  }
  return cli::kExitOk;
}

struct LabelOptions {
  std::string run;
  std::string fault;
  double strength{1.0};
  bool remove{false};
};

int Label(const LabelOptions& options, const Context& context) {
  RunStore store(DataOf(context).runs(), Access::kOccasionalWriter);
  if (options.remove) {
    const int removed = store.RemoveLabels(options.run);
    std::cout << removed << " labels removed\n";
    return cli::kExitOk;
  }
  if (options.fault.empty()) {
    throw ConfigError("FAULT is needed: normal or " + std::string(kFaultNames) +
                      ", or --remove");
  }
  const bool normal = options.fault == "normal";
  const int fault = normal ? 0 : RequireFault(options.fault);
  store.Label(options.run, fault, normal ? 0.0 : options.strength);
  const RunInfo info = store.Info(options.run);
  if (context.options.json) {
    cli::PrintJson(std::cout, RunJson(info));
  } else {
    std::cout << info.id << " labelled " << FaultName(fault) << '\n';
  }
  return cli::kExitOk;
}

int Delete(const std::vector<std::string>& ids, const Context& context) {
  RunStore store(DataOf(context).runs(), Access::kOccasionalWriter);
  Json deleted = Json::array();
  for (const std::string& id : ids) {
    const std::string full = store.Info(id).id;
    store.Delete(full);
    deleted.push_back(full);
    if (!context.options.json) {
      std::cout << full << " deleted\n";
    }
  }
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"deleted", deleted}});
  }
  return cli::kExitOk;
}

void AddLabel(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<LabelOptions>();
  CLI::App& verb = program.AddVerb(
      group, "label", "Say what was true in a run, or a stretch of it",
      [options](const Context& c) { return Label(*options, c); });
  verb.add_option("run", options->run, "ID or ID@from:to in s")->required();
  verb.add_option("fault", options->fault,
                  "normal or " + std::string(kFaultNames));
  verb.add_option("--strength", options->strength, "Strength of the fault [-]")
      ->check(CLI::Range(-1.0, 1.0));
  verb.add_flag("--remove", options->remove, "Remove all labels of the run");
}

}  // namespace

Json RunJson(const RunInfo& info) {
  const NewRun& run = info.run;
  Json intake = Json::object();
  for (std::size_t i = 0; i < info.intake.size(); ++i) {
    intake[std::string(IntakeName(static_cast<Intake>(i)))] = info.intake[i];
  }
  Json labels = Json::array();
  for (const RunLabel& label : info.labels) {
    labels.push_back(RunLabelJson(label));
  }
  return {{"run_id", info.id},
          {"valve_id", run.valve_id},
          {"source_id", Hex(run.source_id)},
          {"origin", std::string(RunOriginName(run.origin))},
          {"state", std::string(RunStateName(info.state))},
          {"start_utc", TimeJson(run.start_ns)},
          {"created_utc", TimeJson(info.created_ns)},
          {"samples", info.samples},
          {"period_s", run.period_s},
          {"flow_unit", std::string(FlowUnitName(run.flow_unit))},
          {"signals", SignalsJson(info.signals)},
          {"has_truth", info.has_truth},
          {"labels", labels},
          {"intake", intake},
          {"stored_bytes", info.stored_bytes},
          {"seed", run.seed ? Json(*run.seed) : Json()},
          {"software", run.software},
          {"scenario", run.scenario}};
}

void AddImportVerb(cli::Program& program, CLI::App& group);

void AddRunsVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup("runs", "Stored runs");
  auto options = std::make_shared<ListOptions>();
  CLI::App& list = program.AddVerb(
      group, "list", "List the runs",
      [options](const Context& c) { return List(*options, c); });
  list.add_option("--valve", options->valve, "Glob over valve ids");
  list.add_option("--origin", options->origin,
                  "simulated, imported or recorded");
  options->window.AddTo(list);

  auto id = std::make_shared<std::string>();
  program
      .AddVerb(group, "show", "Show one run",
               [id](const Context& c) { return Show(*id, c); })
      .add_option("run", *id, "ID or a unique beginning of it")
      ->required();

  AddImportVerb(program, group);

  auto selector = std::make_shared<std::string>();
  auto output = std::make_shared<std::string>("-");
  CLI::App& exporting = program.AddVerb(
      group, "export", "Write a run, or a stretch of it, as CSV",
      [=](const Context& c) { return Export(*selector, *output, c); });
  exporting.add_option("run", *selector, "ID or ID@from:to in s")->required();
  exporting.add_option("--output", *output, "File, or - for stdout");

  AddLabel(program, group);

  auto ids = std::make_shared<std::vector<std::string>>();
  program
      .AddVerb(group, "delete", "Delete runs",
               [ids](const Context& c) { return Delete(*ids, c); })
      .add_option("run", *ids, "IDs")
      ->required();
}

}  // namespace fdi::storage
