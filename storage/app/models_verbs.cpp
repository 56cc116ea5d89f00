#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/app/common.h"
#include "storage/app/verbs.h"
#include "storage/cli/lineage_text.h"
#include "storage/cli/text_table.h"
#include "storage/models.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Context;
using cli::FormatNumber;
using cli::Json;

ModelStore OpenToChange(const Context& context) {
  return ModelStore(WritableDataOf(context).models(),
                    Access::kOccasionalWriter);
}

Json SummaryJson(const ModelSummary& set) {
  return {{"model_set", set.name},
          {"version", set.version},
          {"created_utc", TimeJson(set.created_ns)},
          {"content_hash", Hex(set.content_hash)},
          {"observers", set.observers},
          {"training_runs", set.training_runs},
          {"active", set.active},
          {"preset", set.preset},
          {"period_s", set.period_s},
          {"flow_unit", std::string(FlowUnitName(set.flow_unit))},
          {"lowest_vaf", set.lowest_vaf},
          {"greatest_mse", set.greatest_mse},
          {"greatest_bias", set.greatest_bias},
          {"bytes", set.bytes},
          {"software", set.software}};
}

int List(const Context& context) {
  const auto sets = ModelStore(DataOf(context).models()).List();
  if (context.options.json) {
    Json list = Json::array();
    for (const ModelSummary& set : sets) {
      list.push_back(SummaryJson(set));
    }
    cli::PrintJson(std::cout, {{"model_sets", list}});
    return cli::kExitOk;
  }
  cli::TextTable table({{"model set"},
                        {"active"},
                        {"created"},
                        {"observers", Align::kRight},
                        {"runs", Align::kRight},
                        {"Ts [s]", Align::kRight},
                        {"flow in"},
                        {"lowest VAF [%]", Align::kRight},
                        {"content hash"}});
  for (const ModelSummary& set : sets) {
    table.AddRow(
        {set.name + "@" + std::to_string(set.version), set.active ? "yes" : "",
         TimeText(set.created_ns, context), std::to_string(set.observers),
         std::to_string(set.training_runs), FormatNumber(set.period_s, 3),
         std::string(FlowUnitName(set.flow_unit)),
         FormatNumber(set.lowest_vaf, 2), Hex(set.content_hash)});
  }
  table.Print(std::cout);
  return cli::kExitOk;
}

Json ObserverJson(const ModelSet& models, const Observer& observer) {
  Json channels = Json::array();
  for (std::size_t c = 0; c < observer.channels.size(); ++c) {
    const ValidationFigures& v = observer.channels[c].validation;
    channels.push_back({{"name", models.channels[c].name},
                        {"mse", v.mse},
                        {"vaf", v.vaf},
                        {"bias", v.bias},
                        {"samples", v.samples}});
  }
  return {{"name", observer.name},
          {"fault", FaultName(observer.fault)},
          {"strength", observer.strength},
          {"channels", channels}};
}

Json ModelJson(const ModelSet& models, const ModelSummary& summary,
               const Lineage& lineage) {
  Json object = SummaryJson(summary);
  Json observers = Json::array();
  for (const Observer& observer : models.observers) {
    observers.push_back(ObserverJson(models, observer));
  }
  Json thresholds = Json::array();
  for (const ChannelSpec& channel : models.channels) {
    thresholds.push_back({{"channel", channel.name},
                          {"lower", channel.lower_threshold},
                          {"upper", channel.upper_threshold}});
  }
  object["observers"] = observers;
  object["thresholds"] = thresholds;
  object["undetectable"] = Json::array();
  for (const int fault : models.undetectable) {
    object["undetectable"].push_back(FaultName(fault));
  }
  object["training_runs"] = models.training_runs;
  object["lineage"] = cli::LineageJson(lineage);
  object["t"] = models.decision.isolation_threshold;
  object["n_d"] = models.decision.detection_samples;
  object["t_k"] = models.decision.isolation_samples;
  object["t_c"] = models.decision.clearing_samples;
  return object;
}

void PrintModel(const ModelSet& models, const ModelSummary& summary,
                const Lineage& lineage, const Context& context) {
  const DecisionParameters& d = models.decision;
  std::string runs;
  for (const std::string& run : models.training_runs) {
    runs += (runs.empty() ? "" : " ") + run;
  }
  PrintFields(
      std::cout,
      {{"model set", summary.name + "@" + std::to_string(summary.version) +
                         (summary.active ? " (active)" : "")},
       {"content hash", Hex(summary.content_hash)},
       {"created", TimeText(summary.created_ns, context)},
       {"software", summary.software},
       {"preset", summary.preset},
       {"sample period", FormatNumber(summary.period_s, 3) + " s"},
       {"flow in", std::string(FlowUnitName(summary.flow_unit))},
       {"decision", "T " + FormatNumber(d.isolation_threshold, 2) + ", n_d " +
                        std::to_string(d.detection_samples) + ", t_k " +
                        std::to_string(d.isolation_samples) + ", t_c " +
                        std::to_string(d.clearing_samples) + " samples"},
       {"built on", cli::ParentText(lineage)},
       {"training runs", runs}});
  cli::PrintEpisodes(std::cout, lineage, context.options.utc);
  for (const ChannelSpec& channel : models.channels) {
    std::cout << "abnormal where r_" << channel.name << " < "
              << FormatNumber(channel.lower_threshold, 4) << " or > "
              << FormatNumber(channel.upper_threshold, 4) << ' '
              << (channel.output == Signal::kF ? FlowUnitName(models.flow_unit)
                                               : SignalUnit(channel.output))
              << '\n';
  }
  cli::TextTable table({{"observer"},
                        {"fault"},
                        {"strength [-]", Align::kRight},
                        {"channel"},
                        {"rules", Align::kRight},
                        {"MSE [unit^2]", Align::kRight},
                        {"VAF [%]", Align::kRight},
                        {"bias [unit]", Align::kRight}});
  for (const Observer& observer : models.observers) {
    for (std::size_t c = 0; c < observer.channels.size(); ++c) {
      const ChannelObserver& channel = observer.channels[c];
      const ValidationFigures& v = channel.validation;
      table.AddRow({observer.name, FaultName(observer.fault),
                    FormatNumber(observer.strength, 2), models.channels[c].name,
                    std::to_string(channel.model.rules.size()),
                    FormatNumber(v.mse, 6), FormatNumber(v.vaf, 2),
                    FormatNumber(v.bias, 4)});
    }
  }
  table.Print(std::cout);
}

int Show(const std::string& reference, const Context& context) {
  ModelStore store(DataOf(context).models());
  const ModelSet models = store.Load(reference);
  const ModelSummary summary = store.Summary({models.name, models.version});
  const Lineage lineage = store.LineageOf({models.name, models.version});
  if (context.options.json) {
    cli::PrintJson(std::cout, ModelJson(models, summary, lineage));
  } else {
    PrintModel(models, summary, lineage, context);
  }
  return cli::kExitOk;
}

int Activate(const std::string& text, const Context& context) {
  ModelStore store = OpenToChange(context);
  const ModelReference reference = ParseModelReference(text);
  store.Activate(reference);
  const ModelSummary summary = store.Summary({reference.name, std::nullopt});
  if (context.options.json) {
    cli::PrintJson(std::cout, SummaryJson(summary));
  } else {
    std::cout << summary.name << '@' << summary.version << " is active\n";
  }
  return cli::kExitOk;
}

int Export(const std::string& reference, const std::string& output,
           const Context& context) {
  ModelStore(DataOf(context).models())
      .ExportFile(ParseModelReference(reference), output);
  std::cout << reference << " written to " << output << '\n';
  return cli::kExitOk;
}

int Import(const std::string& file, bool activate, const Context& context) {
  if (!std::filesystem::exists(file)) {
    throw NotFoundError("no file " + file);
  }
  ModelStore store = OpenToChange(context);
  const ModelSet models = store.ImportFile(
      file, activate ? Activation::kAlways : Activation::kIfFirst);
  const ModelSummary summary = store.Summary({models.name, models.version});
  if (context.options.json) {
    cli::PrintJson(std::cout, SummaryJson(summary));
  } else {
    std::cout << summary.name << '@' << summary.version << " stored"
              << (summary.active ? ", active" : "") << '\n';
  }
  return cli::kExitOk;
}

void AddTransfer(cli::Program& program, CLI::App& group) {
  auto reference = std::make_shared<std::string>();
  auto output = std::make_shared<std::string>();
  CLI::App& exporting = program.AddVerb(
      group, "export", "Write a model set to a file",
      [=](const Context& c) { return Export(*reference, *output, c); });
  exporting.add_option("model-set", *reference, "NAME[@VERSION]")->required();
  exporting.add_option("--output", *output, "File to make")->required();

  auto file = std::make_shared<std::string>();
  auto activate = std::make_shared<bool>(false);
  CLI::App& importing = program.AddVerb(
      group, "import", "Store a file as the next version of its model set",
      [=](const Context& c) { return Import(*file, *activate, c); });
  importing.add_option("file", *file, "File that export wrote")->required();
  importing.add_flag("--activate", *activate, "Let it answer from now on");
}

}  // namespace

void AddModelsVerbs(cli::Program& program) {
  CLI::App& group = program.AddGroup("models", "Trained model sets");
  program.AddVerb(group, "list", "List the model sets", List);

  auto shown = std::make_shared<std::string>();
  program
      .AddVerb(group, "show", "Show a model set with its validation",
               [shown](const Context& c) { return Show(*shown, c); })
      .add_option("model-set", *shown, "NAME[@VERSION]")
      ->required();

  auto activated = std::make_shared<std::string>();
  program
      .AddVerb(
          group, "activate", "Let a version answer to the name",
          [activated](const Context& c) { return Activate(*activated, c); })
      .add_option("model-set", *activated, "NAME@VERSION")
      ->required();

  AddTransfer(program, group);
}

}  // namespace fdi::storage
