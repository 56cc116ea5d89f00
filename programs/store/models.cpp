// fdi-store models: list, show, activate, export, import; types: list, show.
#include "storage/models/models.h"

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "programs/store/verbs.h"
#include "report/models/lineage_text.h"
#include "report/text_table.h"
#include "simulator/valve_parameters.h"
#include "storage/models/plant_loops.h"

namespace fdi::storage {
namespace {

using report::Format;
using report::FormatNumber;

Json SummaryJson(const ModelSummary& set) {
  return {{"model_set", set.name},
          {"version", set.version},
          {"created_utc", TimeJson(set.created_ns)},
          {"content_hash", Hex16(set.content_hash)},
          {"observer_count", set.observers},
          {"training_run_count", set.training_runs},
          {"active", set.active},
          {"preset", set.preset},
          {"period_s", set.period_s},
          {"flow_unit", FlowUnitName(set.flow_unit)},
          {"lowest_vaf", VafJson(set.lowest_vaf)},
          {"greatest_mse", NumberJson(set.greatest_mse)},
          {"greatest_bias", NumberJson(set.greatest_bias)},
          {"bytes", set.bytes},
          {"software", set.software}};
}

std::string NameText(const ModelSummary& set) {
  return set.name + "@" + std::to_string(set.version);
}

Report ListModels(const NoOptions&, const Context& context) {
  Report report;
  report.document["model_sets"] =
      Rows(ModelStore(DataOf(context).models()).List(), SummaryJson);
  const auto name = [](const Json& set) {
    return set["model_set"].get<std::string>() + "@" + set["version"].dump();
  };
  const auto active = [](const Json& set) {
    return set["active"].get<bool>() ? "yes" : "";
  };
  return report.Table("model_sets", {TextColumn("model set", name),
                                     TextColumn("active", active),
                                     {"created", "created_utc", Format::kTime},
                                     {"observers", "observer_count"},
                                     {"runs", "training_run_count"},
                                     {"Ts [s]", "period_s", Format::kPlain, 3},
                                     {"flow in", "flow_unit"},
                                     {"lowest VAF [%]", "lowest_vaf"},
                                     {"content hash", "content_hash"}});
}

Json ModelJson(const ModelSet& models, const ModelSummary& summary,
               const Lineage& lineage) {
  Json object = SummaryJson(summary);
  object["undetectable"] = Rows(models.undetectable, FaultName);
  object["training_runs"] = models.training_runs;
  object["lineage"] = report::LineageJson(lineage);
  object["t"] = models.decision.isolation_threshold;
  object["n_d"] = models.decision.detection_samples;
  object["t_k"] = models.decision.isolation_samples;
  object["t_c"] = models.decision.clearing_samples;
  return object;
}

std::string DecisionText(const DecisionParameters& d) {
  return "T " + FormatNumber(d.isolation_threshold, 2) + ", n_d " +
         std::to_string(d.detection_samples) + ", t_k " +
         std::to_string(d.isolation_samples) + ", t_c " +
         std::to_string(d.clearing_samples) + " samples";
}

Report ShowModel(const std::string& reference, const Context& context) {
  ModelStore store(DataOf(context).models());
  const ModelSet models = store.Load(reference);
  const ModelSummary summary = store.Summary({models.name, models.version});
  const Lineage lineage = store.LineageOf({models.name, models.version});
  Report report;
  report.document = ModelJson(models, summary, lineage);
  report.Fields(
      "", {TextField("model set",
                     NameText(summary) + (summary.active ? " (active)" : "")),
           {"content hash", "content_hash"},
           {"created", "created_utc", Format::kTime},
           {"software", "software"},
           {"preset", "preset"},
           TextField("sample period", FormatNumber(summary.period_s, 3) + " s"),
           {"flow in", "flow_unit"},
           TextField("decision", DecisionText(models.decision)),
           TextField("built on", report::ParentText(lineage)),
           TextField("training runs",
                     CLI::detail::join(models.training_runs, " "))});
  report.Table("lineage/episodes", {{"episode", "episode_id"},
                                    {"valve", "valve_id"},
                                    {"label", "label"},
                                    {"by", "labelled_by"},
                                    {"at", "labelled_utc", Format::kTime},
                                    {"taken as", "fault"},
                                    {"strength [-]", "strength"},
                                    {"samples", "samples"},
                                    {"run", "run"}});
  report.Line("fdi-trainer show " + NameText(summary) +
              " has limits, observers and how well they fit, with --rules "
              "their rules");
  return report;
}

Report Activate(const std::string& text, const Context& context) {
  ModelStore store = WritableModels(context);
  const ModelReference reference = ParseModelReference(text);
  store.Activate(reference);
  const ModelSummary summary = store.Summary({reference.name, std::nullopt});
  Report report;
  report.document = SummaryJson(summary);
  return report.Line(NameText(summary) + " is active");
}

struct ModelExportOptions {
  std::string reference;
  std::string output;
};

Report ExportModel(const ModelExportOptions& options, const Context& context) {
  ModelStore(DataOf(context).models())
      .ExportFile(ParseModelReference(options.reference), options.output);
  Report report;
  report.document = {{"model_set", options.reference},
                     {"file", options.output}};
  return report.Line(options.reference + " written to " + options.output);
}

struct ModelImportOptions {
  std::string file;
  bool activate{false};
};

// Imports valves, sets, types and loops from another data directory.
Report ImportPlant(const std::string& folder, ModelStore& store) {
  const DataDirectory part{folder};
  if (!std::filesystem::exists(part.models())) {
    throw NotFoundError(folder +
                        " has no models.db; expected the --data "
                        "directory of fdi-trainer onboard --plant, or a file "
                        "of fdi-store models export");
  }
  ModelStore other(part.models());
  if (std::filesystem::equivalent(part.models(), store.database().path())) {
    throw ConfigError(folder + " is the data directory itself");
  }
  Report report;
  const std::size_t loops = store.TakeLoops(other);
  report.document = {{"from", folder}, {"loops", loops}};
  return report.Line(std::to_string(loops) + " loops of " + folder +
                     " are here with their model sets");
}

Report ImportModel(const ModelImportOptions& options, const Context& context) {
  if (!std::filesystem::exists(options.file)) {
    throw NotFoundError("no file " + options.file);
  }
  ModelStore store = WritableModels(context);
  if (std::filesystem::is_directory(options.file)) {
    return ImportPlant(options.file, store);
  }
  const ModelSet models =
      store.ImportFile(options.file, options.activate ? Activation::kAlways
                                                      : Activation::kIfFirst);
  const ModelSummary summary = store.Summary({models.name, models.version});
  Report report;
  report.document = SummaryJson(summary);
  return report.Line(NameText(summary) + " stored" +
                     (summary.active ? ", active" : ""));
}

Json TypeJson(const ValveType& type) {
  return {{"name", type.name},
          {"created_utc", TimeJson(type.created_ns)},
          {"bytes", type.size},
          {"summary", type.summary}};
}

const std::vector<report::Column> kTypeColumns = {
    {"type", "name"},
    {"created", "created_utc", Format::kTime},
    {"bytes", "bytes"},
    {"summary", "summary"}};

// Stored types, then those that are built in, which need no data folder.
Json AllTypes(const Context& context) {
  const std::filesystem::path path = DataOf(context).models();
  Json types = std::filesystem::exists(path)
                   ? Rows(ModelStore(path).ListTemplates(), TypeJson)
                   : Json::array();
  for (const std::string& name : simulator::ParameterSetNames()) {
    types.push_back(
        {{"name", name},
         {"created_utc", nullptr},
         {"bytes", 0},
         {"summary", "built in: " + Describe(simulator::ParameterSet(name))}});
  }
  return types;
}

Report ListTypes(const NoOptions&, const Context& context) {
  Report report;
  report.document["types"] = AllTypes(context);
  return report.Table("types", kTypeColumns);
}

Report ShowType(const std::string& name, const Context& context) {
  const Json types = AllTypes(context);
  const auto found = std::ranges::find_if(
      types, [&](const Json& type) { return type["name"] == name; });
  if (found == types.end()) {
    throw NotFoundError("no valve type " + name);
  }
  Report report;
  report.document = *found;
  return report.Fields("", kTypeColumns);
}

}  // namespace

void AddModelsVerbs(report::Program& program) {
  CLI::App& group = program.AddGroup("models", "Trained model sets");
  AddVerb(program, group, "list", "List the model sets", ListModels);

  auto [show, shown] =
      AddVerb(program, group, "show",
              "Show a model set, and what it was made from", ShowModel);
  show.add_option("model-set", shown, "NAME[@VERSION]")->required();

  auto [activate, activated] =
      AddVerb(program, group, "activate",
              "Make a version the active one of its name", Activate);
  activate.add_option("model-set", activated, "NAME@VERSION")->required();

  auto [exporting, exported] = AddVerb(
      program, group, "export", "Write a model set to a file", ExportModel);
  exporting.add_option("model-set", exported.reference, "NAME[@VERSION]")
      ->required();
  exporting.add_option("-o,--output", exported.output, "File to write")
      ->required()
      ->type_name("FILE");

  auto [importing, imported] =
      AddVerb(program, group, "import",
              "Store a file as the next version of its model set, or all that "
              "another data directory has of a plant",
              ImportModel);
  importing
      .add_option("file", imported.file,
                  "File written by export, or a data directory")
      ->required();
  importing.add_flag("--activate", imported.activate,
                     "Make it the active version of its name");
}

void AddTypesVerbs(report::Program& program) {
  CLI::App& group = program.AddGroup(
      "types", "Valve types: what the faults do to all valves of one type");
  AddVerb(program, group, "list", "List the valve types", ListTypes);
  auto [show, shown] =
      AddVerb(program, group, "show", "Show a valve type", ShowType);
  show.add_option("type", shown, "Name")->required();
}

}  // namespace fdi::storage
