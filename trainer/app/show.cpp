#include <filesystem>
#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/cli/lineage_text.h"
#include "storage/cli/logging.h"
#include "storage/cli/output_folder.h"
#include "storage/cli/program.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "trainer/app/model_pictures.h"
#include "trainer/app/model_report.h"
#include "trainer/app/rule_text.h"
#include "trainer/app/training_residuals.h"
#include "trainer/app/verbs.h"

namespace fdi::trainer {
namespace {

struct ShowOptions {
  std::string model_set;
  bool rules{false};
  std::filesystem::path pictures;
};

std::string Text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string DecisionText(const DecisionParameters& d) {
  return "T " + Text(d.isolation_threshold) + " in " +
         Text(100.0 * d.isolation_fraction) + " % of t_k " +
         std::to_string(d.isolation_samples) + " (joins in " +
         Text(100.0 * d.join_fraction) + " %), n_d " +
         std::to_string(d.detection_samples) + ", t_c " +
         std::to_string(d.clearing_samples) + ", settling " +
         std::to_string(d.settling_samples) + " samples; evidence over " +
         Text(d.evidence_window) + " samples, core " + Text(d.evidence_core) +
         ", support " + Text(d.evidence_support);
}

std::string TrainingRunsText(const ModelSet& models) {
  std::string text = std::to_string(models.training_runs.size()) + ":";
  for (const std::string& run : models.training_runs) {
    text += ' ' + run;
  }
  return text;
}

void PrintSummary(std::ostream& out, const ModelSet& models,
                  const storage::Lineage& lineage, bool active, bool utc) {
  cli::TextTable table({{"model set"},
                        {models.name + "@" + std::to_string(models.version) +
                         (active ? " (active)" : "")}});
  const auto add = [&table](const char* key, const std::string& value) {
    table.AddRow({key, value});
  };
  add("content hash", HashText(models.content_hash));
  add("created", cli::FormatTime(models.created_ns, utc));
  add("software", models.software);
  add("preset", models.preset);
  add("sample period", Text(models.sample_period_s) + " s");
  add("flow unit", std::string(FlowUnitName(models.flow_unit)));
  add("commands", Text(models.validity.cv.minimum) + ".." +
                      Text(models.validity.cv.maximum) + " %");
  add("faults", FaultsText(models.faults));
  add("thresholds", "for " + Text(models.false_alarms_per_hour) +
                        " false alarms per hour, from " +
                        Text(models.threshold_hours) + " h without fault");
  add("decision", DecisionText(models.decision));
  add("built on", cli::ParentText(lineage));
  add("training runs", TrainingRunsText(models));
  table.Print(out);
  out << '\n';
  if (!lineage.episodes.empty()) {
    cli::PrintEpisodes(out, lineage, utc);
    out << '\n';
  }
}

void PrintRules(std::ostream& out, const ModelSet& models) {
  out << "\nRules. (k-1) of the output itself is the model's own prediction.\n";
  for (const Observer& observer : models.observers) {
    for (std::size_t c = 0; c < observer.channels.size(); ++c) {
      out << '\n'
          << observer.name << ", " << models.channels[c].name << ":\n"
          << RulesText(observer.channels[c].model, models.flow_unit);
    }
  }
}

cli::Json DecisionJson(const DecisionParameters& d) {
  return {{"isolation_threshold", d.isolation_threshold},
          {"detection_samples", d.detection_samples},
          {"isolation_samples", d.isolation_samples},
          {"isolation_fraction", d.isolation_fraction},
          {"join_fraction", d.join_fraction},
          {"reisolation_samples", d.reisolation_samples},
          {"clearing_samples", d.clearing_samples},
          {"settling_samples", d.settling_samples},
          {"evidence_window", d.evidence_window},
          {"evidence_core", d.evidence_core},
          {"evidence_support", d.evidence_support}};
}

cli::Json WindowsJson(const ChannelSpec& channel) {
  cli::Json windows = cli::Json::array();
  for (const WindowLimits& window : channel.windows) {
    windows.push_back({{"length", window.length},
                       {"lower_mean", window.lower_mean},
                       {"upper_mean", window.upper_mean},
                       {"upper_log_rms", window.upper_log_rms},
                       {"activity_slope", window.activity_slope},
                       {"log_activity", window.log_activity}});
  }
  return windows;
}

cli::Json RuleJson(const TsRule& rule) {
  cli::Json sets = cli::Json::array();
  for (const FuzzySet& set : rule.antecedents) {
    sets.push_back({{"left_center", set.left_center},
                    {"right_center", set.right_center},
                    {"left_width", set.left_width},
                    {"right_width", set.right_width}});
  }
  return {{"antecedents", std::move(sets)}, {"center", rule.center},
          {"metric", rule.metric},          {"slopes", rule.slopes},
          {"intercept", rule.intercept},    {"data_share", rule.data_share}};
}

void AddRules(const ModelSet& models, cli::Json& json) {
  for (std::size_t o = 0; o < models.observers.size(); ++o) {
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      const TsModel& model = models.observers[o].channels[c].model;
      cli::Json& channel = json["observers"][o]["channels"][c];
      channel["regressor_min"] = model.regressor_min;
      channel["regressor_max"] = model.regressor_max;
      channel["rule_list"] = cli::Json::array();
      for (const TsRule& rule : model.rules) {
        channel["rule_list"].push_back(RuleJson(rule));
      }
    }
  }
}

cli::Json SetJson(const ModelSet& models, bool active, bool rules) {
  cli::Json json = ModelsJson(models);
  json["active"] = active;
  json["created_utc"] = cli::FormatTime(models.created_ns, true);
  json["software"] = models.software;
  json["preset"] = models.preset;
  json["sample_period_s"] = models.sample_period_s;
  json["flow_unit"] = FlowUnitName(models.flow_unit);
  json["trained_cv"] = {models.validity.cv.minimum, models.validity.cv.maximum};
  json["threshold_hours"] = models.threshold_hours;
  json["false_alarms_per_hour"] = models.false_alarms_per_hour;
  json["decision"] = DecisionJson(models.decision);
  json["training_runs"] = models.training_runs;
  json["channels"] = cli::Json::array();
  for (const ChannelSpec& channel : models.channels) {
    json["channels"].push_back(
        {{"name", channel.name},
         {"output", SignalName(channel.output)},
         {"unit", UnitOf(channel.output, models.flow_unit)},
         {"lower_threshold", channel.lower_threshold},
         {"upper_threshold", channel.upper_threshold},
         {"windows", WindowsJson(channel)}});
  }
  if (rules) {
    AddRules(models, json);
  }
  return json;
}

void DrawPictures(const ModelSet& models, const std::filesystem::path& folder,
                  const storage::DataDirectory& directory,
                  const cli::Context& context) {
  cli::EnsureFolder(folder);
  const TrainingResiduals residuals =
      RepeatTrainingResiduals(models, directory);
  for (const std::string& missing : residuals.missing) {
    context.log(LogLevel::kWarning,
                cli::EventLine("residuals_missing", {{"reason", missing}}));
  }
  const int count = WriteModelPictures(models, residuals, folder);
  context.log(LogLevel::kInfo,
              cli::EventLine("pictures_written",
                             {{"folder", folder.string()},
                              {"pictures", std::to_string(count)}}));
}

int Show(const ShowOptions& options, const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  const ModelSet models = store.Load(options.model_set);
  const bool active = store.Summary({models.name, models.version}).active;
  if (!options.pictures.empty()) {
    DrawPictures(models, options.pictures, directory, context);
  }
  const storage::Lineage lineage =
      store.LineageOf({models.name, models.version});
  if (context.options.json) {
    cli::Json json = SetJson(models, active, options.rules);
    json["lineage"] = cli::LineageJson(lineage);
    cli::PrintJson(std::cout, json);
    return cli::kExitOk;
  }
  PrintSummary(std::cout, models, lineage, active, context.options.utc);
  PrintModels(std::cout, models);
  if (options.rules) {
    PrintRules(std::cout, models);
  }
  return cli::kExitOk;
}

}  // namespace

void AddShowVerb(cli::Program& program) {
  auto options = std::make_shared<ShowOptions>();
  CLI::App& verb = program.AddVerb("show", "Show a model set, and its rules",
                                   [options](const cli::Context& context) {
                                     return Show(*options, context);
                                   });
  verb.add_option("model-set", options->model_set,
                  "NAME (its active version) or NAME@VERSION")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_flag("--rules", options->rules, "Print the rules in words");
  verb.add_option("--pictures", options->pictures,
                  "Write SVG files: fuzzy sets of the normal models, residual "
                  "memberships of all observers over their residuals")
      ->type_name("DIR");
}

}  // namespace fdi::trainer
