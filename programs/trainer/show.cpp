#include <string>

#include <CLI/CLI.hpp>

#include "base/time_text.h"
#include "diagnosis/model/model_set.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/verbs.h"
#include "report/models/lineage_text.h"
#include "report/program.h"
#include "report/report.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "trainer/campaign/campaign_fields.h"
#include "trainer/learning/labelled_episodes.h"
#include "trainer/rule_text.h"
#include "trainer/scoring/evaluated_run.h"

namespace fdi::trainer {
namespace {

using report::Json;

struct ShowOptions {
  std::string model_set;
  bool rules{false};
};

std::string Text(double value) {
  return Digits(value, 6);
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
         ", support " + Text(d.evidence_support) +
         ", interpolation allowance " + Text(d.interpolation_allowance) +
         ", early error " + Text(d.early_error);
}

std::string TrainingRunsText(const ModelSet& models) {
  std::string text = std::to_string(models.training_runs.size()) + ":";
  for (const std::string& run : models.training_runs) {
    text += ' ' + run;
  }
  return text;
}

Json RuleJson(const TsRule& rule) {
  Json sets = Json::array();
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

Json SetJson(ModelSet models, bool active, const storage::Lineage& lineage) {
  Json json = ModelsJson(models);
  json["active"] = active;
  json["created_utc"] = FormatTime(models.created_ns, true);
  json["software"] = models.software;
  json["preset"] = models.preset;
  json["sample_period_s"] = models.sample_period_s;
  json["flow_unit"] = FlowUnitName(models.flow_unit);
  json["trained_cv"] = {models.validity.cv.minimum, models.validity.cv.maximum};
  json["faults"] = FaultsJson(models.faults);
  json["threshold_hours"] = models.threshold_hours;
  json["false_alarms_per_hour"] = models.false_alarms_per_hour;
  VisitDecision(models.decision,
                [&json](const char* key, const auto& field, auto...) {
                  json["decision"][key] = field;
                });
  json["training_runs"] = models.training_runs;
  json["lineage"] = report::LineageJson(lineage);
  return json;
}

void AddSummary(const ModelSet& models, const storage::Lineage& lineage,
                bool active, report::Report& report) {
  const auto field = [](std::string heading, std::string text) {
    return report::Column{
        .heading = std::move(heading),
        .key = "",
        .text = [text = std::move(text)](const Json&) { return text; }};
  };
  report.Fields(
      "", {field("model set", NameOf(models) + (active ? " (active)" : "")),
           {"content hash", "content_hash"},
           {"created", "created_utc", report::Format::kTime},
           {"software", "software"},
           {"preset", "preset"},
           field("sample period", Text(models.sample_period_s) + " s"),
           {"flow unit", "flow_unit"},
           field("commands", Text(models.validity.cv.minimum) + ".." +
                                 Text(models.validity.cv.maximum) + " %"),
           field("faults", FaultsText(models.faults)),
           field("false alarms", AlarmRateText(models)),
           field("decision", DecisionText(models.decision)),
           field("built on", report::ParentText(lineage)),
           field("training runs", TrainingRunsText(models))});
  report.Line("");
  if (!lineage.episodes.empty()) {
    AddEpisodeTable(report);
    report.Line("");
  }
}

void AddRules(const ModelSet& models, report::Report& report) {
  report.Line(
      "\nRules. (k-1) of the output itself is the model's own prediction.");
  for (std::size_t o = 0; o < models.observers.size(); ++o) {
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      const TsModel& model = models.observers[o].channels[c].model;
      Json& channel = report.document["observers"][o]["channels"][c];
      channel["regressor_min"] = model.regressor_min;
      channel["regressor_max"] = model.regressor_max;
      channel["rule_list"] = Json::array();
      for (const TsRule& rule : model.rules) {
        channel["rule_list"].push_back(RuleJson(rule));
      }
      std::string rules = RulesText(model, models.flow_unit);
      rules.pop_back();  // The line ends by itself.
      report.Line("\n" + models.observers[o].name + ", " +
                  models.channels[c].name + ":\n" + rules);
    }
  }
}

report::Report Show(const ShowOptions& options,
                    const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  const ModelSet models = store.Load(options.model_set);
  const storage::ModelReference reference{models.name, models.version};
  const storage::Lineage lineage = store.LineageOf(reference);
  const bool active = store.Summary(reference).active;
  report::Report report;
  report.document = SetJson(models, active, lineage);
  AddSummary(models, lineage, active, report);
  AddModelTables(models, report);
  if (options.rules) {
    AddRules(models, report);
  }
  return report;
}

}  // namespace

void AddShowVerb(report::Program& program) {
  auto [verb, options] =
      AddVerb(program, "show", "Show a model set, and its rules", Show);
  verb.add_option("model-set", options.model_set,
                  "NAME (its active version) or NAME@VERSION")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_flag("--rules", options.rules, "Print the rules in words");
  program.AddExamples(
      {{"show",
        {{"Fit of every observer", "fdi-trainer show paper"},
         {"Its rules in words", "fdi-trainer show paper@2 --rules"}}}});
}

}  // namespace fdi::trainer
