#include "trainer/learning/label_plan.h"

#include <algorithm>
#include <limits>
#include <set>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign_fields.h"
#include "trainer/campaign/run_input.h"
#include "trainer/scoring/evaluate.h"

// From labels to what is learnt: which episodes can be used and as which fault,
// which runs are trained on beside them, and what the new set descends from
// (docs/learning.md). MakeLabelPlan() only reads, so that a dry run can show
// the plan; StoreEvidence() is the one function here that writes.
namespace fdi::trainer {
namespace {

using storage::TrainingEpisode;
using Json = nlohmann::ordered_json;

constexpr std::int64_t kEndOfTime = std::numeric_limits<std::int64_t>::max();

// The settings that the set was trained with: those of its preset, overridden
// by what the set holds and, since versions that store them, by its lineage. Of
// a set of onboarding only the options of the data set are used.
TrainingOptions SettingsOf(const ModelSet& models,
                           const storage::Lineage& lineage) {
  TrainingOptions options;
  try {
    options = IsOnboarded(models) ? options : PresetOptions(models.preset);
  } catch (const ConfigError&) {
    throw DataError("model set " + NameOf(models) + " is of preset '" +
                    models.preset +
                    "': only sets of fdi-trainer train (paper, extended) and "
                    "of fdi-trainer onboard can be relearnt");
  }
  options.name = models.name;
  options.decision = models.decision;
  options.false_alarms_per_hour = models.false_alarms_per_hour;
  if (!lineage.settings.empty() && !IsOnboarded(models)) {
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

std::string NameOfSet(const storage::Episode& episode) {
  return storage::ParseModelReference(episode.model_set).name;
}

// The set that is assigned to the valve, or else the active version of the one
// that diagnosed the labelled episodes.
ModelSet ParentOf(const std::string& valve,
                  const std::vector<storage::Episode>& episodes,
                  storage::ModelStore& store) {
  if (const auto assigned = store.AssignedModelSet(valve)) {
    return store.Load(*assigned);
  }
  std::set<std::string> names;
  for (const storage::Episode& episode : episodes) {
    if (episode.label) {
      names.insert(NameOfSet(episode));
    }
  }
  if (names.empty()) {
    throw NotFoundError("valve " + valve +
                        " has neither a model set nor a labelled episode: see "
                        "fdi-trainer onboard and fdi-store history label");
  }
  if (names.size() > 1) {
    throw ConfigError("the labelled episodes are of several model sets (" +
                      JoinText(names) +
                      "): choose the one to build on with fdi-store valves "
                      "assign");
  }
  return store.Load(*names.begin());
}

void RequireSameEpoch(const std::string& valve, const ModelSet& models,
                      storage::ModelStore& store) {
  const auto entry = store.FindValve(valve);
  if (entry && entry->baseline() == storage::BaselineState::kProvisional) {
    throw DataError("valve " + valve + " was changed since model set " +
                    NameOf(models) + " was made: onboard it anew");
  }
}

std::vector<storage::Episode> EpisodesOf(
    const std::string& glob, std::optional<storage::HistoryReader>& history) {
  storage::EpisodeFilter filter;
  filter.valve_glob = glob;
  return history ? history->List(filter) : std::vector<storage::Episode>();
}

// The episodes whose labels count. Those labelled false, which tune the limits
// of an onboarded valve, count from the making of its observers on.
std::vector<storage::Episode> LabelledOf(const RelearnRequest& request,
                                         const LabelPlan& plan) {
  std::vector<storage::Episode> labelled;
  for (const storage::Episode& episode : plan.episodes) {
    const bool healthy = episode.label == "false" && IsOnboarded(*plan.parent);
    if (episode.label &&
        episode.detected_ns >=
            (healthy ? plan.since_ns
                     : request.from_ns.value_or(episode.detected_ns)) &&
        episode.detected_ns < request.to_ns.value_or(kEndOfTime)) {
      labelled.push_back(episode);
    }
  }
  return labelled;
}

// Each given strength is of one episode.
void CheckStrengths(const GivenStrengths& strengths,
                    const std::vector<storage::Episode>& episodes) {
  for (const auto& [id, strength] : strengths) {
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
}

bool Contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

// The present label of an episode that the parent has learnt from, or
// null.
const LabelledEpisode* SameEpisode(const std::vector<LabelledEpisode>& read,
                                   const TrainingEpisode& before) {
  const auto now =
      std::find_if(read.begin(), read.end(), [&](const LabelledEpisode& e) {
        return e.meaning.episode_id == before.episode_id;
      });
  return now == read.end() ? nullptr : &*now;
}

bool IsStored(const std::string& run, storage::RunStore& store) {
  try {
    store.Info(run);
    return true;
  } catch (const NotFoundError&) {
    return false;
  }
}

void PlanRuns(const std::vector<std::string>& more,
              const std::filesystem::path& file, LabelPlan& plan) {
  std::set<std::string> replaced;
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    // Lessons of another label are forgotten even if the new one teaches
    // nothing. Under the same label the evidence outlives the trace.
    const LabelledEpisode* refused = SameEpisode(plan.refused, before);
    const bool withdrawn =
        refused != nullptr && refused->meaning.label != before.label;
    if (withdrawn || SameEpisode(plan.learnt, before) != nullptr) {
      replaced.insert(before.run);
    }
    plan.has_news = plan.has_news || withdrawn;
  }
  std::optional<storage::RunStore> store;
  if (std::filesystem::exists(file)) {
    store.emplace(file);
  }
  for (const std::string& run : plan.parent->training_runs) {
    if (replaced.contains(run)) {
      continue;
    }
    // The record of onboarding is not read again, and may be a file.
    const auto evidence =
        std::ranges::find(plan.lineage.episodes, run, &TrainingEpisode::run);
    const bool onboarded = IsOnboarded(*plan.parent);
    if ((onboarded && evidence == plan.lineage.episodes.end()) ||
        (store && IsStored(run, *store))) {
      plan.runs.push_back(run);
    } else if (!onboarded || evidence->fault != 0) {
      plan.missing.push_back(run);
    }
  }
  for (const std::string& selector : more) {
    // In full, as the parent names its runs. `last` would mean another run once
    // the evidence of the labels is stored.
    const std::string run =
        SelectorOf(storage::RunStore(file).Info(selector).id,
                   storage::ParseRunSelector(selector));
    if (!Contains(plan.runs, run)) {
      plan.runs.push_back(run);
    }
  }
}

// True if the label asks for other models. One that calls an alarm of an
// onboarded valve false asks for other limits, unless it taught a fault before.
bool AsksForModels(const LabelledEpisode& episode, const LabelPlan& plan) {
  return !IsOnboarded(*plan.parent) || episode.meaning.fault != 0 ||
         std::ranges::any_of(
             plan.lineage.episodes, [&](const TrainingEpisode& before) {
               return before.episode_id == episode.meaning.episode_id &&
                      before.fault != 0;
             });
}

// True if the parent has not learnt the same from the same samples.
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

// Sets of limits or of taught observers say so in their settings. The text is
// empty of sets whose origin is unknown; then nothing is found in it.
bool KeepsObservers(const storage::Lineage& lineage) {
  const auto settings = Json::parse(lineage.settings, nullptr, false);
  return !settings.contains(kModelsKey) &&
         (settings.contains(kLimitsKey) || settings.contains(kTaughtKey));
}

// A name that tells the evidence of one label from that of another:
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

// Pieces in which the observers settle and something is left.
std::vector<Stretch> PiecesOf(const TrainingRun& run, const LabelPlan& plan) {
  const int needed = plan.parent->decision.settling_samples +
                     plan.training.dataset.dropped_after_step;
  std::vector<Stretch> pieces =
      SplitAtGaps(plan.parent->position_as_command ? AtPosition(run) : run);
  std::erase_if(pieces, [needed](const Stretch& piece) {
    return piece.samples.size() < static_cast<std::size_t>(needed);
  });
  return pieces;
}

std::vector<Lesson> LessonsOf(const LabelPlan& plan,
                              const storage::DataDirectory& directory) {
  std::vector<Lesson> lessons;
  for (const LabelledEpisode& episode : plan.learnt) {
    if (episode.meaning.fault == 0) {
      continue;
    }
    TrainingRun run = RunOf(episode, *plan.parent);
    run.id = "episode " + episode.meaning.episode_id;
    lessons.push_back(
        {episode.meaning.fault, episode.meaning.strength, PiecesOf(run, plan)});
  }
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    if (before.fault != 0 && Contains(plan.runs, before.run) &&
        SameEpisode(plan.learnt, before) == nullptr) {
      storage::RunStore store(directory.runs());
      TrainingRun run = ToTrainingRun(store.Load(before.run), false);
      run.id = "episode " + before.episode_id;
      lessons.push_back({before.fault, before.strength, PiecesOf(run, plan)});
    }
  }
  return JoinLessons(std::move(lessons));
}

}  // namespace

bool IsOnboarded(const ModelSet& models) {
  return models.preset == "onboard";
}

ModelSet FirstSet(const ModelSet& models, storage::ModelStore& store) {
  // Each set that was made from another one names it; the chain ends where the
  // observers were made.
  ModelSet first = models;
  storage::Lineage lineage = store.LineageOf({first.name, first.version});
  while (lineage.parent && KeepsObservers(lineage)) {
    const storage::ModelReference parent{lineage.parent->name,
                                         lineage.parent->version};
    first = store.Load(parent);
    lineage = store.LineageOf(parent);
  }
  return first;
}

Teaching TeachFrom(const LabelPlan& plan, const ModelSet& models,
                   const storage::DataDirectory& directory) {
  Teaching teaching;
  for (const Lesson& lesson : LessonsOf(plan, directory)) {
    try {
      teaching.taught.push_back(Teach(models, lesson));
    } catch (const DataError& error) {
      std::set<std::string> episodes;
      for (const Stretch& stretch : lesson.stretches) {
        episodes.insert(stretch.run_id);
      }
      throw DataError(JoinText(episodes) + ": " + error.what());
    }
  }
  teaching.models = WithTaught(models, teaching.taught);
  return teaching;
}

std::vector<int> NameIn(const std::shared_ptr<const ModelSet>& models,
                        const LabelledEpisode& episode) {
  return Evaluate(models, episode.record).last_set;
}

std::string SettingsText(const TrainingOptions& options) {
  TrainingOptions copy = options;
  Json json = Json::object();
  VisitTraining(copy, [&json](const char* key, const auto& field, auto...) {
    json[key] = field;
  });
  return json.dump();
}

LabelPlan MakeLabelPlan(const RelearnRequest& request,
                        const storage::DataDirectory& directory) {
  std::optional<storage::HistoryReader> history;
  if (std::filesystem::exists(directory.history())) {
    history.emplace(directory.history());
  }
  LabelPlan plan;
  storage::ModelStore store(directory.models());
  plan.episodes = EpisodesOf(request.valve, history);
  plan.parent = std::make_shared<const ModelSet>(
      ParentOf(request.valve, plan.episodes, store));
  const bool onboarded = IsOnboarded(*plan.parent);
  if (onboarded) {
    RequireSameEpoch(request.valve, *plan.parent, store);
    plan.episodes = EpisodesOf(GlobOf(request.valve), history);
  }
  plan.since_ns =
      request.from_ns.value_or(FirstSet(*plan.parent, store).created_ns);
  plan.lineage = store.LineageOf({plan.parent->name, plan.parent->version});
  plan.training = SettingsOf(*plan.parent, plan.lineage);
  const auto labelled = LabelledOf(request, plan);
  if (labelled.empty() && !onboarded) {
    throw NotFoundError("no labelled episode of valve " + request.valve +
                        " in that time: see fdi-store history label");
  }
  CheckStrengths(request.strengths, labelled);
  plan.has_news = !onboarded && !request.runs.empty();
  for (const storage::Episode& episode : labelled) {
    LabelledEpisode read = LabelReader(*history, directory.runs(), plan.parent,
                                       plan.training.dataset, request.strengths)
                               .Read(episode);
    if (onboarded && episode.label != "false" &&
        NameOfSet(episode) != plan.parent->name) {
      read.refusal = "it was diagnosed by " + episode.model_set +
                     ", and a set of onboarding learns from its own valve";
    }
    if (read.refusal.empty()) {
      plan.has_news = plan.has_news ||
                      (AsksForModels(read, plan) && IsNew(read, plan.lineage));
      plan.learnt.push_back(std::move(read));
    } else {
      plan.refused.push_back(std::move(read));
    }
  }
  PlanRuns(onboarded ? std::vector<std::string>() : request.runs,
           directory.runs(), plan);
  return plan;
}

std::string RefusalText(const LabelledEpisode& episode) {
  return "episode " + episode.meaning.episode_id + " of valve " +
         episode.meaning.valve_id + ", label " + episode.meaning.label + ": " +
         episode.refusal;
}

// An alarm that was false and cannot be read leaves the limits as they are; a
// fault that cannot be read would be missing from the models.
void RequireUsable(const LabelPlan& plan) {
  const std::string parent = NameOf(*plan.parent);
  if (!plan.missing.empty()) {
    throw DataError(
        std::to_string(plan.missing.size()) + " of the " +
        std::to_string(plan.parent->training_runs.size()) + " runs that " +
        parent + " was trained on are not in runs.db: " +
        JoinText(plan.missing) + "; --skip-refused does without them");
  }
  std::vector<LabelledEpisode> refused = plan.refused;
  std::erase_if(refused, [&](const LabelledEpisode& episode) {
    return IsOnboarded(*plan.parent) && episode.meaning.label == "false";
  });
  if (!refused.empty()) {
    throw DataError(JoinText(refused, "; ", RefusalText) +
                    "; --skip-refused does without " +
                    (refused.size() == 1 ? "it" : "them"));
  }
}

// The samples of an episode become an imported run before the training, because
// a set names the runs that it was made from, and its successor is trained on
// them again. A repeated command finds the runs of the first one
// (IsEvidenceOf).
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

// Episodes of the parent are handed down as long as their runs are used, unless
// the same episode is learnt from again.
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

// A signal that some runs lack is taken from all of them. If the parent needs
// one of these, nothing is changed, and the training itself refuses the runs.
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
