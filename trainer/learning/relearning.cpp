#include "trainer/learning/relearning.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <limits>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "simulator/second_look/valve_physics.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/evaluation.h"
#include "trainer/scoring/evaluate.h"

namespace fdi::trainer {
std::vector<std::string> HealthyRuns(const RelearnRequest& request,
                                     const LabelPlan& labels,
                                     const storage::DataDirectory& directory) {
  const bool onboarded = IsOnboarded(*labels.parent);
  if (onboarded && !(request.runs.empty() && request.files.empty())) {
    return request.runs;
  }
  std::vector<std::string> selectors;
  if (!std::filesystem::exists(directory.runs())) {
    return selectors;
  }
  storage::RunFilter filter;
  filter.valve_glob = onboarded ? GlobOf(request.valve) : request.valve;
  filter.origin = storage::RunOrigin::kRecorded;
  const std::int64_t until_ns =
      request.to_ns.value_or(std::numeric_limits<std::int64_t>::max());
  for (const storage::RunInfo& info :
       storage::RunStore(directory.runs()).List(filter)) {
    if (info.samples == 0 || info.last_stamp_ns < labels.since_ns ||
        info.first_stamp_ns >= until_ns) {
      continue;
    }
    const bool whole =
        info.first_stamp_ns >= labels.since_ns && info.last_stamp_ns < until_ns;
    selectors.push_back(whole ? info.id
                              : SelectorOf(info, labels.since_ns, until_ns));
  }
  return selectors;
}

namespace {

// A fault acts on the residuals before an alarm tells of it.
constexpr std::int64_t kBeforeEpisodeNs = 10 * kNsPerMinute;

struct TimeSpan {
  std::string valve;
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
};

bool HasRun(const std::vector<std::string>& words, const std::string& word) {
  return std::ranges::find(words, word) != words.end();
}

// The time that is not known to be healthy, or that is read with an episode.
std::vector<TimeSpan> ExcludedSpans(const LabelPlan& labels) {
  const std::int64_t clearing_ns =
      std::llround(labels.parent->decision.clearing_samples *
                   labels.parent->sample_period_s * 1e9);
  std::vector<TimeSpan> spans;
  for (const storage::Episode& episode : labels.episodes) {
    const auto read =
        std::ranges::find_if(labels.learnt, [&](const LabelledEpisode& other) {
          return other.meaning.episode_id == episode.episode_id &&
                 other.meaning.fault == 0;
        });
    // An episode that was healthy is read by itself. Just its own samples are
    // left out of the runs, which may hold them as well: they must not count
    // twice.
    if (read != labels.learnt.end()) {
      spans.push_back({episode.valve_id, read->samples.front().sample.stamp_ns,
                       read->samples.back().sample.stamp_ns});
    } else {
      // Nothing after the detection of an open episode is known to be healthy.
      spans.push_back({episode.valve_id, episode.detected_ns - kBeforeEpisodeNs,
                       episode.ended_ns
                           ? *episode.ended_ns + clearing_ns
                           : std::numeric_limits<std::int64_t>::max()});
    }
  }
  return spans;
}

// Calls visit(run, seconds left out) for each run of healthy hours.
void ForEachHealthyRun(
    const RelearnRequest& request, const LabelPlan& labels,
    const storage::DataDirectory& directory,
    const std::function<void(const storage::StoredRun&, double)>& visit) {
  const bool onboarded = IsOnboarded(*labels.parent);
  const std::vector<TimeSpan> spans = ExcludedSpans(labels);
  const auto read = [&](storage::StoredRun run) {
    const std::size_t all = run.samples.size();
    std::erase_if(run.samples, [&](const storage::StoredSample& stored) {
      const std::int64_t stamp_ns = stored.sample.stamp_ns;
      return std::ranges::any_of(spans, [&](const TimeSpan& span) {
        return stamp_ns >= span.from_ns && stamp_ns <= span.to_ns &&
               (onboarded || span.valve == run.info.run.valve_id);
      });
    });
    const double left_out_s = labels.parent->sample_period_s *
                              static_cast<double>(all - run.samples.size());
    if (!run.samples.empty()) {
      ConvertFlow(run, simulator::FlowTargetOf(*labels.parent), {});
    }
    visit(run, left_out_s);
  };
  for (const std::string& selector : HealthyRuns(request, labels, directory)) {
    std::optional<storage::StoredRun> run;
    try {
      run = storage::RunStore(directory.runs()).Load(selector);
    } catch (const NotFoundError&) {
      if (!request.runs.empty()) {
        throw;
      }
      continue;  // The run has a pause there.
    }
    read(std::move(*run));
  }
  for (const storage::StoredRun& run : request.files) {
    read(run);
  }
}

// The samples that an episode teaches, as a run.
storage::StoredRun EvidenceOf(const LabelledEpisode& episode,
                              const ModelSet& models) {
  storage::StoredRun run;
  run.info.id = "episode " + episode.meaning.episode_id;
  run.info.run.period_s = models.sample_period_s;
  run.info.run.flow_unit = models.flow_unit;
  run.info.signals = episode.samples.front().sample.present;
  for (const LabelledSample& labelled : episode.samples) {
    run.samples.emplace_back().sample = labelled.sample;
  }
  return run;
}

// The samples of false alarms: those read now, and those that the parent has
// learnt from and that cannot be read any more.
std::vector<storage::StoredRun> EvidenceOf(const LabelPlan& labels,
                                           const std::filesystem::path& runs) {
  std::vector<storage::StoredRun> evidence;
  for (const LabelledEpisode& episode : labels.learnt) {
    if (episode.meaning.fault == 0) {
      evidence.push_back(EvidenceOf(episode, *labels.parent));
    }
  }
  // These runs are read here and are not among those of the plan.
  for (const storage::TrainingEpisode& before : labels.lineage.episodes) {
    if (before.fault == 0 && HasRun(labels.runs, before.run)) {
      evidence.push_back(storage::RunStore(runs).Load(before.run));
    }
  }
  return evidence;
}

bool Alarms(const std::shared_ptr<const ModelSet>& models,
            const LabelledEpisode& episode) {
  return std::ranges::any_of(ScoreRun(models, RunOf(episode, *models)),
                             &Indication::detected);
}

std::string AnswerOf(const std::shared_ptr<const ModelSet>& models,
                     const LabelledEpisode& episode, bool& right) {
  if (episode.meaning.fault == 0) {
    right = !Alarms(models, episode);
    return right ? "no alarm" : "alarm";
  }
  const std::vector<int> named = NameIn(models, episode);
  right = std::ranges::find(named, episode.meaning.fault) != named.end();
  return named.empty() ? "unknown" : SetText(named);
}

std::string Count(int count, const char* noun) {
  return std::to_string(count) + ' ' + noun + (count == 1 ? "" : "s");
}

}  // namespace

bool Relearning::changes_limits() const {
  return limits &&
         (parent().floor != limits->models.floor ||
          !std::ranges::equal(LimitsOf(parent()), LimitsOf(limits->models), {},
                              &Limit::value, &Limit::value));
}

void LearnHours(const RelearnRequest& request,
                const storage::DataDirectory& directory, Relearning& learnt) {
  const ModelSet& parent = learnt.parent();
  ForEachHealthyRun(request, learnt.labels, directory,
                    [&](const storage::StoredRun& run, double left_out_s) {
                      learnt.episodes_left_out_s += left_out_s;
                      if (!run.samples.empty()) {
                        AddResiduals(learnt.labels.parent, run, learnt.healthy);
                        learnt.runs.push_back(RunName(run));
                      }
                    });
  const std::vector<storage::StoredRun> evidence =
      EvidenceOf(learnt.labels, directory.runs());
  const bool asked = !learnt.labels.has_news || !request.runs.empty() ||
                     !request.files.empty();
  const auto samples = static_cast<std::size_t>(learnt.healthy.samples);
  if (evidence.empty() && samples < (asked ? 1 : kMinResiduals)) {
    if (asked) {
      throw NotFoundError(
          "there is nothing to learn: no label that is new, and no healthy "
          "hours of the valve (" +
          std::to_string(std::llround(learnt.episodes_left_out_s)) +
          " s belong to episodes that are not labelled false): record them "
          "with "
          "fdi-monitor run --record, or name them with --runs or --file");
    }
    return;
  }
  {
    // Before the evidence of false alarms is added: a person has called those
    // samples healthy, so they may reach as far as they do.
    storage::ModelStore store(directory.models());
    RequireHealthy(FirstSet(parent, store), parent,
                   PeaksOf(parent, learnt.healthy));
  }
  HealthyResiduals all = learnt.healthy;
  for (const storage::StoredRun& run : evidence) {
    AddResiduals(learnt.labels.parent, run, all);
  }
  learnt.peaks = PeaksOf(parent, all);
  learnt.limits = SetLimits(parent, all);
  learnt.models = learnt.limits->models;
  learnt.faults = CompareVisibility(parent, learnt.models, all.excerpt);
}

void LearnFaults(const storage::DataDirectory& directory, Relearning& learnt) {
  Teaching teaching = TeachFrom(learnt.labels, learnt.models, directory);
  learnt.models = std::move(teaching.models);
  learnt.taught = std::move(teaching.taught);
}

void CompareWithParent(const RelearnRequest& request,
                       const storage::DataDirectory& directory,
                       Relearning& learnt) {
  ParentComparison& result = learnt.comparison;
  const auto now = std::make_shared<const ModelSet>(learnt.models);
  ForEachHealthyRun(request, learnt.labels, directory,
                    [&](const storage::StoredRun& healthy, double) {
                      // A run with a fault that nobody labelled says nothing of
                      // false alarms.
                      if (healthy.samples.empty() || FaultOf(healthy) != 0) {
                        return;
                      }
                      try {
                        const EvaluatedRun first =
                            Evaluate(learnt.labels.parent, healthy, true);
                        const EvaluatedRun second =
                            Evaluate(now, healthy, true);
                        result.alarms_before += first.indices.episodes;
                        result.alarms_after += second.indices.episodes;
                        result.hours += second.duration_s / 3600.0;
                      } catch (const DataError&) {
                        // Another period or a missing signal: it suits
                        // neither set.
                      }
                    });
  if (result.alarms_after > result.alarms_before) {
    char hours[32];
    std::snprintf(hours, sizeof hours, "%.2f", result.hours);
    result.worse.push_back("it raises " + Count(result.alarms_after, "alarm") +
                           " in " + hours +
                           " h of healthy operation, the parent " +
                           std::to_string(result.alarms_before));
  }
  for (const LabelledEpisode& episode : learnt.labels.learnt) {
    bool right_before = false;
    bool right_after = false;
    const EpisodeAnswers& answers = result.episodes.emplace_back(
        EpisodeAnswers{AnswerOf(learnt.labels.parent, episode, right_before),
                       AnswerOf(now, episode, right_after)});
    if (right_before && !right_after) {
      result.worse.push_back("episode " + episode.meaning.episode_id +
                             ", labelled " + episode.meaning.label +
                             ", would be " + answers.after + " instead of " +
                             answers.before);
    }
  }
  std::vector<std::string> lost;
  for (const CoverageChange& change : learnt.faults) {
    if (change.lost()) {
      lost.push_back(FaultName(change.fault) + (change.negative ? " (-)" : ""));
    }
  }
  if (!lost.empty()) {
    result.worse.push_back("it does not see " + JoinText(lost) +
                           " at any strength, the parent does");
  }
}

std::string SettingsText(const Relearning& learnt) {
  nlohmann::json json = nlohmann::json::object();
  if (learnt.anew) {
    json[kModelsKey] = {{"hours", learnt.anew->baseline.hours}};
  }
  if (learnt.limits) {
    json[kLimitsKey] = {{"hours", learnt.limits->hours},
                        {"fitted", learnt.limits->fitted},
                        {"runs", learnt.runs}};
  }
  nlohmann::json& taught = json[kTaughtKey] = nlohmann::json::array();
  for (const TaughtObserver& one : learnt.taught) {
    taught.push_back(one.observer.name);
  }
  return json.dump();
}

ModelSet StoreRelearned(Relearning& learnt, const std::string& valve,
                        const std::string& settings, bool activate,
                        const storage::DataDirectory& directory,
                        const std::string& software, std::int64_t created_ns) {
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  // The evidence is stored before the set that names its runs: a crash in
  // between leaves runs that no set names, not a set whose runs do not exist.
  if (!learnt.labels.learnt.empty()) {
    StoreEvidence(learnt.labels, directory, software);
  }
  storage::Lineage lineage = LineageOf(learnt.labels);
  lineage.settings = settings;
  ModelSet models = learnt.models;
  models.software = software;
  models.created_ns = created_ns;
  if (learnt.anew) {
    // Alarms that were false are part of the record that the models are of.
    std::erase_if(lineage.episodes, [](const storage::TrainingEpisode& e) {
      return e.fault == 0;
    });
  } else if (IsOnboarded(models)) {
    models.training_runs = learnt.labels.runs;
  }
  const auto add = [&](const std::string& run) {
    if (!HasRun(models.training_runs, run)) {
      models.training_runs.push_back(run);
    }
  };
  std::ranges::for_each(learnt.runs, add);
  std::ranges::for_each(lineage.episodes, add, &storage::TrainingEpisode::run);
  if (activate && learnt.anew) {
    learnt.anew->models = models;
    learnt.anew->lineage = lineage;
    return *store.Store(*learnt.anew);
  }
  models = store.Save(
      models,
      activate ? storage::Activation::kAlways : storage::Activation::kIfFirst,
      lineage);
  if (!activate || !IsOnboarded(models)) {
    return models;
  }
  // With AssignModelSet() only, an onboarded valve would have no baseline.
  // Its parameters are the same, so the record of the onboarding is repeated
  // for the new set.
  const auto entry = store.FindValve(valve);
  const std::vector<storage::BaselineRecord> baselines = store.Baselines(valve);
  if (entry && entry->pattern == valve && !baselines.empty() &&
      entry->baseline() == storage::BaselineState::kValid) {
    storage::BaselineRecord record = baselines.back();
    record.model_set = models.name;
    record.version = models.version;
    record.hours = models.threshold_hours;
    store.SetBaseline(valve, record);
  } else {
    store.AssignModelSet(valve,
                         storage::ModelReference{models.name, models.version});
  }
  return models;
}

}  // namespace fdi::trainer
