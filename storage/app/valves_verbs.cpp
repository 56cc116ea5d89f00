#include <filesystem>
#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/app/common.h"
#include "storage/app/valve_baselines.h"
#include "storage/app/verbs.h"
#include "storage/cli/signal_list.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history.h"
#include "storage/models.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::Json;

ModelStore OpenToChange(const Context& context) {
  return ModelStore(WritableDataOf(context).models(),
                    Access::kOccasionalWriter);
}

std::string SetText(const std::optional<ModelReference>& reference) {
  return reference ? ToString(*reference) : "-";
}

std::string SenseText(Sense sense) {
  return sense == Sense::kClosing ? "closing" : "opening";
}

Json ValveJson(const ValveEntry& valve) {
  return {{"valve", valve.pattern},
          {"type", valve.type},
          {"flow_unit", std::string(FlowUnitName(valve.flow_unit))},
          {"sense", SenseText(valve.sense)},
          {"signals", SignalsJson(valve.signals)},
          {"period_s", valve.period_s},
          {"epoch", valve.epoch},
          {"baseline", std::string(BaselineStateName(valve.baseline()))},
          {"model_set",
           valve.model_set ? Json(ToString(*valve.model_set)) : Json()}};
}

int List(const Context& context) {
  const auto valves = ModelStore(DataOf(context).models()).Valves();
  if (context.options.json) {
    Json list = Json::array();
    for (const ValveEntry& valve : valves) {
      list.push_back(ValveJson(valve));
    }
    cli::PrintJson(std::cout, {{"valves", list}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"valve"},
                        {"type"},
                        {"flow in"},
                        {"% of"},
                        {"signals"},
                        {"Ts [s]", Align::kRight},
                        {"epoch", Align::kRight},
                        {"baseline"},
                        {"model set"}});
  for (const ValveEntry& valve : valves) {
    table.AddRow(
        {valve.pattern, valve.type, std::string(FlowUnitName(valve.flow_unit)),
         SenseText(valve.sense), cli::SignalsText(valve.signals),
         cli::FormatNumber(valve.period_s, 3), std::to_string(valve.epoch),
         std::string(BaselineStateName(valve.baseline())),
         SetText(valve.model_set)});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

// Time by quality; nothing if no monitor has run here.
std::vector<CoverageTime> CoverageOf(const std::string& valve_id,
                                     const Context& context) {
  const auto path = DataOf(context).history();
  if (!std::filesystem::exists(path)) {
    return {};
  }
  EpisodeFilter filter;
  filter.valve_glob = valve_id;
  return HistoryReader(path).Coverage(filter);
}

// What counts for one valve: the entry that matches it and the set it gets.
int Show(const std::string& valve_id, const Context& context) {
  ModelStore store(DataOf(context).models());
  const auto entry = store.FindValve(valve_id);
  const auto assigned = store.AssignedModelSet(valve_id);
  if (!entry && !assigned) {
    throw NotFoundError("no entry and no active model set for valve '" +
                        valve_id + "'");
  }
  if (context.options.json) {
    Json object = entry ? ValveJson(*entry) : Json::object();
    object["valve_id"] = valve_id;
    object["diagnosed_with"] = assigned ? Json(ToString(*assigned)) : Json();
    if (entry) {
      AddEpochs(store, entry->pattern, object);
    }
    object["hours"] = HoursJson(CoverageOf(valve_id, context));
    cli::PrintJson(std::cout, object);
    return cli::kExitOk;
  }
  std::vector<std::pair<std::string, std::string>> fields = {
      {"valve", valve_id},
      {"diagnosed with", assigned ? ToString(*assigned) : "UNASSIGNED"}};
  if (entry) {
    fields.insert(
        fields.end(),
        {{"entry", entry->pattern},
         {"type", entry->type},
         {"flow in", std::string(FlowUnitName(entry->flow_unit))},
         {"% of", SenseText(entry->sense)},
         {"signals", cli::SignalsText(entry->signals)},
         {"sample period", cli::FormatNumber(entry->period_s, 3) + " s"},
         {"epoch", std::to_string(entry->epoch)},
         {"baseline", std::string(BaselineStateName(entry->baseline()))}});
  }
  PrintFields(std::cout, fields);
  if (entry) {
    PrintEpochs(std::cout, store, entry->pattern, context);
  }
  PrintHours(std::cout, CoverageOf(valve_id, context));
  return cli::kExitOk;
}

void Report(const ValveEntry& entry, const Context& context) {
  if (context.options.json) {
    cli::PrintJson(std::cout, ValveJson(entry));
  } else {
    std::cout << entry.pattern << ": model set " << SetText(entry.model_set)
              << ", epoch " << entry.epoch << ", baseline "
              << BaselineStateName(entry.baseline()) << '\n';
  }
}

ValveEntry RequireEntry(ModelStore& store, const std::string& pattern) {
  for (const ValveEntry& entry : store.Valves()) {
    if (entry.pattern == pattern) {
      return entry;
    }
  }
  throw NotFoundError("no valve entry '" + pattern + "'");
}

struct AddOptions {
  std::string pattern;
  std::string type;
  std::string flow_unit{"m3/h"};
  std::string sense{"closing"};
  std::string signals{"CV,P1,P2,T1,X,F"};
  std::string model_set;
  double period_s{1.0};
  std::uint32_t epoch{0};
};

int Add(const AddOptions& options, const Context& context) {
  ValveEntry entry;
  entry.pattern = options.pattern;
  entry.type = options.type;
  entry.flow_unit = *ParseFlowUnit(options.flow_unit);
  entry.sense = options.sense == "opening" ? Sense::kOpening : Sense::kClosing;
  entry.signals = ParseSignals(options.signals);
  entry.period_s = options.period_s;
  entry.epoch = options.epoch;
  ModelStore store = OpenToChange(context);
  if (!options.model_set.empty()) {
    entry.model_set = ParseModelReference(options.model_set);
    store.Summary(*entry.model_set);  // It must exist.
  }
  store.PutValve(entry);
  Report(entry, context);
  return cli::kExitOk;
}

int Assign(const std::string& pattern, const std::string& set,
           const Context& context) {
  ModelStore store = OpenToChange(context);
  store.AssignModelSet(pattern, set == "none"
                                    ? std::nullopt
                                    : std::optional(ParseModelReference(set)));
  Report(RequireEntry(store, pattern), context);
  return cli::kExitOk;
}

struct EventOptions {
  std::string pattern;
  std::string kind;
  std::string note;
  std::string at;
  std::string who{UserName()};
};

// A replaced, repacked or recalibrated valve is another valve to its models.
int Event(const EventOptions& options, const Context& context) {
  ValveEvent event;
  event.kind = ParseValveEventKind(options.kind);
  event.note = options.note;
  event.at_ns =
      options.at.empty() ? cli::NowNs() : cli::ParseTime(options.at, true);
  event.who = options.who;
  Report(OpenToChange(context).AddValveEvent(options.pattern, event), context);
  return cli::kExitOk;
}

int Remove(const std::string& pattern, const Context& context) {
  OpenToChange(context).RemoveValve(pattern);
  if (context.options.json) {
    cli::PrintJson(std::cout, {{"removed", pattern}});
  } else {
    std::cout << pattern << " removed\n";
  }
  return cli::kExitOk;
}

void AddAdd(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<AddOptions>();
  CLI::App& verb = program.AddVerb(
      group, "add", "Describe a valve, or all whose id matches a glob",
      [options](const Context& c) { return Add(*options, c); });
  verb.add_option("valve", options->pattern, "Id or glob")->required();
  verb.add_option("--type", options->type, "Free text");
  verb.add_option("--flow-unit", options->flow_unit, "m3/h or t/h")
      ->check(CLI::IsMember({"m3/h", "t/h"}));
  verb.add_option("--sense", options->sense, "closing or opening: CV, X in %")
      ->check(CLI::IsMember({"closing", "opening"}));
  verb.add_option("--signals", options->signals, "Signals it delivers");
  verb.add_option("--period", options->period_s, "Sample period in s")
      ->check(CLI::PositiveNumber);
  verb.add_option("--epoch", options->epoch,
                  "Replacements and recalibrations so far");
  verb.add_option("--model-set", options->model_set, "NAME[@VERSION]");
}

void AddEvent(cli::Program& program, CLI::App& group) {
  auto options = std::make_shared<EventOptions>();
  CLI::App& verb = program.AddVerb(
      group, "event",
      "Note what was done to a valve: the next epoch, in which no fault is "
      "isolated until the valve is onboarded again",
      [options](const Context& c) { return Event(*options, c); });
  verb.add_option("valve", options->pattern, "Id, or the glob of an entry")
      ->required();
  verb.add_option("--kind", options->kind, "replaced, repacked, recalibrated")
      ->required();
  verb.add_option("--note", options->note, "Free text");
  verb.add_option("--at", options->at, "When, RFC 3339 in UTC (default: now)")
      ->type_name("UTC");
  verb.add_option("--by", options->who, "Who says so");
}

}  // namespace

void AddValvesVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup("valves", "Valves and their model sets");
  program.AddVerb(group, "list", "List the entries, first match first", List);

  const auto add_by_name =
      [&](const char* name, const char* description,
          int (*action)(const std::string&, const Context&)) {
        auto valve = std::make_shared<std::string>();
        program
            .AddVerb(
                group, name, description,
                [valve, action](const Context& c) { return action(*valve, c); })
            .add_option("valve", *valve, "Id, or the glob of an entry")
            ->required();
      };
  add_by_name("show", "Show which entry and model set a valve gets", Show);
  AddAdd(program, group);

  auto pattern = std::make_shared<std::string>();
  auto set = std::make_shared<std::string>();
  CLI::App& assign = program.AddVerb(
      group, "assign", "Assign a model set to a valve or glob",
      [=](const Context& c) { return Assign(*pattern, *set, c); });
  assign.add_option("valve", *pattern, "Id or glob")->required();
  assign.add_option("model-set", *set, "NAME[@VERSION] or none")->required();

  AddEvent(program, group);
  add_by_name("remove", "Remove an entry", Remove);
}

}  // namespace fdi::storage
