#include "trainer/learning/label_plan.h"

#include <algorithm>
#include <set>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign_fields.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer {
namespace {

using storage::TrainingEpisode;
using Json = nlohmann::ordered_json;

// The settings that the set was trained with: those of its preset, overridden
// by what the set holds and, since versions that store them, by its lineage.
TrainingOptions SettingsOf(const ModelSet& models,
                           const storage::Lineage& lineage) {
  TrainingOptions options;
  try {
    options = PresetOptions(models.preset);
  } catch (const ConfigError&) {
    throw DataError("model set " + NameOf(models) + " is of preset '" +
                    models.preset +
                    "': only sets of fdi-trainer train (paper, extended) can "
                    "be trained on; onboard the valve anew instead");
  }
  options.name = models.name;
  options.decision = models.decision;
  options.false_alarms_per_hour = models.false_alarms_per_hour;
  if (!lineage.settings.empty()) {
    try {
      const Json json = Json::parse(lineage.settings);
      VisitTraining(options, [&json](const char* key, auto& field, auto...) {
        field = json.value(key, field);
      });
    } catch (const Json::exception& error) {
      throw DataError("model set " + NameOf(models) +
                      ": its settings are damaged: " + error.what());
    }
  }
  return options;
}

// The labelled episodes of the request; each given strength is of one of them.
std::vector<storage::Episode> FindLabelled(storage::HistoryReader& history,
                                           const LabelRequest& request) {
  std::vector<storage::Episode> episodes = history.List(request.filter);
  std::erase_if(episodes,
                [](const storage::Episode& e) { return !e.label.has_value(); });
  if (episodes.empty()) {
    throw NotFoundError("no labelled episode of valve " +
                        request.filter.valve_glob +
                        " in that time: see fdi-store history label");
  }
  for (const auto& [id, strength] : request.strengths) {
    const auto matches =
        std::count_if(episodes.begin(), episodes.end(),
                      [&id = id](const storage::Episode& episode) {
                        return episode.episode_id.starts_with(id);
                      });
    if (matches != 1) {
      throw NotFoundError("--strength " + id + ": " +
                          (matches == 0 ? "no labelled episode begins"
                                        : std::to_string(matches) +
                                              " labelled episodes begin") +
                          " like that");
    }
  }
  return episodes;
}

// The one set that diagnosed the episodes.
std::string ParentOf(const std::vector<storage::Episode>& episodes) {
  std::set<std::string> sets;
  for (const storage::Episode& episode : episodes) {
    sets.insert(episode.model_set);
  }
  if (sets.size() > 1) {
    throw ConfigError("the labelled episodes are of several model sets (" +
                      JoinText(sets) +
                      "): choose the one to build on with --parent "
                      "NAME[@VERSION]");
  }
  return *sets.begin();
}

bool Contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// What the label of an episode says now that the parent has learnt from, or
// null.
const LabelledEpisode* SameEpisode(const std::vector<LabelledEpisode>& read,
                                   const TrainingEpisode& before) {
  const auto now =
      std::find_if(read.begin(), read.end(), [&](const LabelledEpisode& e) {
        return e.meaning.episode_id == before.episode_id;
      });
  return now == read.end() ? nullptr : &*now;
}

void PlanRuns(const LabelRequest& request, const std::filesystem::path& file,
              LabelPlan& plan) {
  std::set<std::string> replaced;
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    // What another label taught is forgotten even if the new one teaches
    // nothing. Under the same label the evidence outlives the trace.
    const LabelledEpisode* refused = SameEpisode(plan.refused, before);
    const bool withdrawn =
        refused != nullptr && refused->meaning.label != before.label;
    if (withdrawn || SameEpisode(plan.learnt, before) != nullptr) {
      replaced.insert(before.run);
    }
    plan.has_news = plan.has_news || withdrawn;
  }
  storage::RunStore store(file);
  for (const std::string& run : plan.parent->training_runs) {
    if (replaced.contains(run)) {
      continue;
    }
    try {
      store.Info(run);
      plan.runs.push_back(run);
    } catch (const NotFoundError&) {
      plan.missing.push_back(run);
    }
  }
  for (const std::string& selector : request.runs) {
    // In full, as the parent names its runs. `last` would mean another run once
    // the evidence of the labels is stored.
    const std::string run = SelectorOf(store.Info(selector).id,
                                       storage::ParseRunSelector(selector));
    if (!Contains(plan.runs, run)) {
      plan.runs.push_back(run);
    }
  }
}

// Whether the parent has not learnt the same from the same samples.
bool IsNew(const LabelledEpisode& episode, const storage::Lineage& lineage) {
  const TrainingEpisode& now = episode.meaning;
  return std::none_of(lineage.episodes.begin(), lineage.episodes.end(),
                      [&](const TrainingEpisode& before) {
                        return before.episode_id == now.episode_id &&
                               before.fault == now.fault &&
                               before.strength == now.strength &&
                               before.samples == now.samples;
                      });
}

// What tells the evidence of one label from that of another:
// "episode 00c0ffee12345678 as f19 0.5".
std::string EvidenceName(const TrainingEpisode& meaning) {
  std::string text =
      "episode " + meaning.episode_id + " as " + FaultName(meaning.fault);
  if (meaning.fault != 0) {
    char strength[32];
    std::snprintf(strength, sizeof strength, " %.17g", meaning.strength);
    text += strength;
  }
  return text;
}

bool IsEvidenceOf(const storage::RunInfo& run, const LabelledEpisode& episode) {
  return run.run.origin == storage::RunOrigin::kImported &&
         run.run.scenario == EvidenceName(episode.meaning) &&
         run.labels.empty() &&
         run.samples == static_cast<std::int64_t>(episode.samples.size()) &&
         run.first_stamp_ns == episode.samples.front().sample.stamp_ns &&
         run.last_stamp_ns == episode.samples.back().sample.stamp_ns;
}

}  // namespace

std::string SettingsText(const TrainingOptions& options) {
  TrainingOptions copy = options;
  Json json = Json::object();
  VisitTraining(copy, [&json](const char* key, const auto& field, auto...) {
    json[key] = field;
  });
  return json.dump();
}

LabelPlan MakeLabelPlan(const LabelRequest& request,
                        const storage::DataDirectory& directory) {
  storage::HistoryReader history(directory.history());
  const auto episodes = FindLabelled(history, request);
  LabelPlan plan;
  storage::ModelStore store(directory.models());
  plan.parent = std::make_shared<const ModelSet>(
      store.Load(request.parent.empty() ? ParentOf(episodes) : request.parent));
  plan.lineage = store.LineageOf({plan.parent->name, plan.parent->version});
  plan.training = SettingsOf(*plan.parent, plan.lineage);
  LabelReader reader(history, directory.runs(), plan.parent,
                     plan.training.dataset, request.strengths);
  plan.has_news = !request.runs.empty();
  for (const storage::Episode& episode : episodes) {
    LabelledEpisode read = reader.Read(episode);
    if (read.refusal.empty()) {
      plan.has_news = plan.has_news || IsNew(read, plan.lineage);
      plan.learnt.push_back(std::move(read));
    } else {
      plan.refused.push_back(std::move(read));
    }
  }
  PlanRuns(request, directory.runs(), plan);
  return plan;
}

std::string RefusalText(const LabelledEpisode& episode) {
  return "episode " + episode.meaning.episode_id + " of valve " +
         episode.meaning.valve_id + ", label " + episode.meaning.label + ": " +
         episode.refusal;
}

void RequireTrainable(const LabelPlan& plan, bool drop_missing,
                      bool skip_refused) {
  const std::string parent = NameOf(*plan.parent);
  if (!plan.missing.empty() && !drop_missing) {
    throw DataError(
        std::to_string(plan.missing.size()) + " of the " +
        std::to_string(plan.parent->training_runs.size()) + " runs that " +
        parent +
        " was trained on are not in runs.db: " + JoinText(plan.missing) +
        "; --drop-missing does without "
        "them");
  }
  if (!plan.refused.empty() && !skip_refused) {
    throw DataError(JoinText(plan.refused, "; ", RefusalText) +
                    "; --skip-refused does without " +
                    (plan.refused.size() == 1 ? "it" : "them"));
  }
  if (!plan.has_news) {
    throw DataError("nothing to learn: " + parent +
                    " has learnt from all of the labelled episodes that can "
                    "be used");
  }
}

int StoreEvidence(LabelPlan& plan, const storage::DataDirectory& directory,
                  const std::string& software) {
  storage::RunStore store(directory.runs(), storage::Access::kOccasionalWriter);
  const std::vector<storage::RunInfo> known = store.List();
  int stored = 0;
  for (LabelledEpisode& episode : plan.learnt) {
    const auto found = std::find_if(known.begin(), known.end(),
                                    [&](const storage::RunInfo& run) {
                                      return IsEvidenceOf(run, episode);
                                    });
    if (found != known.end()) {
      episode.meaning.run = found->id;
      continue;
    }
    const Sample& first = episode.samples.front().sample;
    SampleSeries series;
    series.samples = episode.samples;
    series.flow_unit = plan.parent->flow_unit;
    series.period_s = plan.parent->sample_period_s;
    series.has_truth = true;
    series.signals = first.present;
    storage::NewRun row;
    row.scenario = EvidenceName(episode.meaning);
    row.software = software;
    row.valve_id = episode.meaning.valve_id;
    row.source_id = first.source_id;
    row.start_ns = first.stamp_ns;
    episode.meaning.run = store.Import({&series, 1}, row).front();
    ++stored;
  }
  return stored;
}

storage::Lineage LineageOf(const LabelPlan& plan) {
  storage::Lineage lineage;
  lineage.parent = storage::ParentSet{plan.parent->name, plan.parent->version,
                                      plan.parent->content_hash};
  for (const LabelledEpisode& episode : plan.learnt) {
    lineage.episodes.push_back(episode.meaning);
  }
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    if (Contains(plan.runs, before.run) &&
        SameEpisode(plan.learnt, before) == nullptr) {
      lineage.episodes.push_back(before);
    }
  }
  return lineage;
}

void RestrictToCommonSignals(const ModelSet& parent,
                             std::vector<TrainingRun>& runs) {
  auto common = static_cast<SignalMask>(~SignalMask{0});
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      common &= labelled.sample.present;
    }
  }
  const SignalMask required = RequiredSignals(parent);
  if ((common & required) != required) {
    return;
  }
  for (TrainingRun& run : runs) {
    for (LabelledSample& labelled : run.samples) {
      labelled.sample.present = common;
    }
  }
}

}  // namespace fdi::trainer
