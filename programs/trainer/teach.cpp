#include "programs/trainer/teach.h"

#include <chrono>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "programs/trainer/model_report.h"
#include "report/models/lineage_text.h"
#include "storage/database/data_directory.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/fleet/valve_types.h"
#include "trainer/scoring/evaluated_run.h"

namespace fdi::trainer {
namespace {

using report::FormatNumber;
using report::Json;

Json TaughtJson(const std::vector<TaughtObserver>& taught) {
  Json json = Json::array();
  for (const TaughtObserver& one : taught) {
    json.push_back(
        {{"observer", one.observer.name},
         {"fault", FaultName(one.observer.fault)},
         {"strength", one.observer.strength},
         {"adapted_from",
          one.adapted_from.empty() ? Json() : Json(one.adapted_from)},
         {"samples", one.samples},
         {"gain_over_normal", one.gain_over_normal},
         {"gain_over_former", one.gain_over_former}});
  }
  return json;
}

std::string NameText(const std::vector<int>& set) {
  return set.empty() ? "unknown" : SetText(set);
}

// The episodes are what was learnt from: the new names say that it was learnt,
// and not how sure they are.
Json NamesJson(const LabelPlan& plan, const ModelSet& models) {
  const auto next = std::make_shared<const ModelSet>(models);
  Json names = Json::array();
  for (const LabelledEpisode& episode : plan.learnt) {
    names.push_back({{"episode_id", episode.meaning.episode_id},
                     {"label", episode.meaning.label},
                     {"before", NameText(NameIn(plan.parent, episode))},
                     {"after", NameText(NameIn(next, episode))}});
  }
  return names;
}

void AddTables(const LabelPlan& plan, const ModelSet& models, bool activated,
               report::Report& report) {
  report.Table("taught", {{"observer", "observer"},
                          {"adapted from", "adapted_from"},
                          {"samples", "samples"},
                          {.heading = "better than normal",
                           .key = "gain_over_normal",
                           .decimals = 0},
                          {.heading = "than that before",
                           .key = "gain_over_former",
                           .decimals = 0}});
  report.Line(
      "better: log-likelihood of parts of the episodes that were left out; a "
      "difference of " +
      FormatNumber(models.decision.evidence_support, 0) + " refutes");
  report.Table("names", {{"episode", "episode_id"},
                         {"label", "label"},
                         {"by " + NameOf(*plan.parent), "before"},
                         {"by " + NameOf(models), "after"}});
  report.Line(activated
                  ? NameOf(models) + " is in use from now on"
                  : NameOf(models) +
                        " is not in use yet. Compare both on other runs of "
                        "the valve, then activate it:\n"
                        "  fdi-trainer compare " +
                        NameOf(*plan.parent) + ' ' + NameOf(models) +
                        " --runs ID,...\n  fdi-store models activate " +
                        NameOf(models));
}

// The type whose valves get what this one has learnt.
FoundType RequireType(const std::string& name, const ModelSet& parent,
                      storage::ModelStore& store) {
  FoundType found = FindType(name, &store);
  if (!found.stored || found.model_set.empty() ||
      storage::ParseModelReference(found.model_set).name != parent.name) {
    throw ConfigError(
        "--type " + name + ": accepted is a type that was saved with " +
        parent.name + ", see fdi-store types list" +
        (found.model_set.empty() ? "" : "; this one has " + found.model_set));
  }
  return found;
}

void OfferToType(const std::string& name, const FoundType& found,
                 const ModelSet& models, storage::ModelStore& store) {
  const std::string text = TypeText(found.type, &models);
  store.SaveTemplate(name, std::as_bytes(std::span(text)),
                     store.LoadTemplate(name).summary);
}

}  // namespace

report::Report TeachAndStore(const LabelPlan& plan, const TeachOptions& options,
                             report::StopSignals& signals,
                             const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  FoundType type;
  if (!options.type.empty()) {
    type = RequireType(options.type, *plan.parent, store);
  }
  Teaching teaching = TeachFrom(plan, directory);
  if (signals.stop_requested()) {
    throw Interrupted("interrupted: no model set was stored");
  }
  signals.EndWithin(std::chrono::milliseconds(0));
  teaching.models.software = context.software;
  teaching.models.created_ns = NowNs();
  teaching.models.training_runs = plan.runs;
  storage::Lineage lineage = LineageOf(plan);
  for (const LabelledEpisode& episode : plan.learnt) {
    teaching.models.training_runs.push_back(episode.meaning.run);
  }
  const Json taught = TaughtJson(teaching.taught);
  lineage.settings = Json({{"taught", taught}}).dump();
  const ModelSet models =
      store.Save(teaching.models, storage::Activation::kIfFirst, lineage);
  if (options.activate) {
    store.Activate({models.name, models.version});
  }
  if (!options.type.empty()) {
    OfferToType(options.type, type, models, store);
  }
  report::Report report;
  report.document = ModelsJson(models);
  report.document["lineage"] =
      report::LineageJson(store.LineageOf({models.name, models.version}));
  report.document["taught"] = taught;
  report.document["names"] = NamesJson(plan, models);
  report.Line("model set " + NameOf(models) + ", hash " +
              storage::HashHex(models.content_hash) + ", " +
              report::ParentText(lineage) + "\n");
  AddEpisodeTable(report);
  AddTables(plan, models, options.activate, report);
  return report;
}

}  // namespace fdi::trainer
