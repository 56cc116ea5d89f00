#include "trainer/learning/limits_plan.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/time_units.h"
#include "diagnosis/records/valve_glob.h"
#include "simulator/second_look/valve_physics.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

// A fault acts on the residuals before an alarm tells of it.
constexpr std::int64_t kBeforeEpisodeNs = 10 * kNsPerMinute;
// Under this key the lineage of a set that was made here tells from what.
constexpr const char* kLimits = "limits";
// Under this one that of a set that labels have taught.
constexpr const char* kTaught = "taught";

struct TimeSpan {
  std::int64_t from_ns{0};
  std::int64_t to_ns{0};
};

bool HasRun(const std::vector<std::string>& words, const std::string& word) {
  return std::ranges::find(words, word) != words.end();
}

bool IsStored(const std::string& run, const std::filesystem::path& file) {
  try {
    storage::RunStore(file).Info(run);
    return true;
  } catch (const NotFoundError&) {
    return false;
  }
}

}  // namespace

std::shared_ptr<const ModelSet> OnboardedSet(const std::string& valve,
                                             storage::ModelStore& store) {
  const auto reference = store.AssignedModelSet(valve);
  if (!reference) {
    throw NotFoundError("valve " + valve +
                        " has no model set: see fdi-trainer onboard");
  }
  auto models = std::make_shared<const ModelSet>(store.Load(*reference));
  if (!IsOnboarded(*models)) {
    throw DataError("model set " + NameOf(*models) + " of valve " + valve +
                    " was not made by fdi-trainer onboard: see fdi-trainer "
                    "train --from-labels");
  }
  const auto entry = store.FindValve(valve);
  if (entry && entry->baseline() == storage::BaselineState::kProvisional) {
    throw DataError("valve " + valve + " was changed since model set " +
                    NameOf(*models) + " was made: onboard it anew");
  }
  return models;
}

namespace {

// Older sets have no settings, and an empty text is no JSON. Without exceptions
// parse() then returns a value that contains nothing.
bool IsMadeFromAnother(const storage::Lineage& lineage) {
  const auto settings = nlohmann::json::parse(lineage.settings, nullptr, false);
  return settings.contains(kLimits) || settings.contains(kTaught);
}

}  // namespace

ModelSet FirstSet(const ModelSet& models, storage::ModelStore& store) {
  // Each set made here names its predecessor; the chain ends at onboarding.
  ModelSet first = models;
  storage::Lineage lineage = store.LineageOf({first.name, first.version});
  while (IsMadeFromAnother(lineage) && lineage.parent) {
    const storage::ModelReference parent{lineage.parent->name,
                                         lineage.parent->version};
    first = store.Load(parent);
    lineage = store.LineageOf(parent);
  }
  return first;
}

namespace {

// The episodes of the valve, by detection.
std::vector<storage::Episode> EpisodesOf(const std::string& valve,
                                         storage::HistoryReader& history) {
  storage::EpisodeFilter filter;
  filter.valve_glob = GlobOf(valve);
  return history.List(filter);
}

// The time that is not known to be healthy, or that is read with an episode.
std::vector<TimeSpan> ExcludedSpans(
    const std::vector<storage::Episode>& episodes, const LabelPlan& labels) {
  const std::int64_t clearing_ns =
      std::llround(labels.parent->decision.clearing_samples *
                   labels.parent->sample_period_s * 1e9);
  std::vector<TimeSpan> spans;
  for (const storage::Episode& episode : episodes) {
    // Of an episode that is read, just its own samples are left out of the
    // runs, which may hold them as well: they must not count twice.
    const auto read = std::ranges::find(
        labels.learnt, episode.episode_id,
        [](const LabelledEpisode& e) { return e.meaning.episode_id; });
    if (read != labels.learnt.end()) {
      spans.push_back({read->samples.front().sample.stamp_ns,
                       read->samples.back().sample.stamp_ns});
    } else {
      // Nothing after the detection of an open episode is known to be healthy.
      spans.push_back({episode.detected_ns - kBeforeEpisodeNs,
                       episode.ended_ns
                           ? *episode.ended_ns + clearing_ns
                           : std::numeric_limits<std::int64_t>::max()});
    }
  }
  return spans;
}

// Reads one run after the other into the plan.
class RunReader {
 public:
  RunReader(LimitsPlan& plan, std::vector<TimeSpan> left_out)
      : plan_(&plan), left_out_(std::move(left_out)) {}

  void Read(storage::StoredRun run) {
    const std::size_t all = run.samples.size();
    std::erase_if(run.samples, [this](const storage::StoredSample& stored) {
      const std::int64_t stamp_ns = stored.sample.stamp_ns;
      return std::ranges::any_of(left_out_, [=](const TimeSpan& span) {
        return stamp_ns >= span.from_ns && stamp_ns <= span.to_ns;
      });
    });
    plan_->episodes_left_out_s += plan_->parent().sample_period_s *
                                  static_cast<double>(all - run.samples.size());
    if (!run.samples.empty()) {
      ConvertFlow(run, simulator::FlowTargetOf(*plan_->labels.parent), {});
      AddResiduals(plan_->labels.parent, run, plan_->healthy);
      plan_->runs.push_back(RunName(run));
    }
  }

 private:
  LimitsPlan* plan_;
  std::vector<TimeSpan> left_out_;
};

void ReadRuns(LimitsRequest& request, const std::filesystem::path& file,
              RunReader reader, std::int64_t since_ns) {
  const bool named = !request.runs.empty() || !request.files.empty();
  if (!request.runs.empty() || std::filesystem::exists(file)) {
    storage::RunStore store(file);
    for (const std::string& selector : request.runs) {
      reader.Read(store.Load(selector));
    }
    for (const storage::RunInfo& info :
         named ? std::vector<storage::RunInfo>()
               : store.List({.origin = storage::RunOrigin::kRecorded})) {
      if (info.run.valve_id == request.valve && info.samples > 0 &&
          info.last_stamp_ns >= since_ns) {
        storage::StoredRun run = store.Load(info.id);
        std::erase_if(run.samples, [=](const storage::StoredSample& stored) {
          return stored.sample.stamp_ns < since_ns;
        });
        reader.Read(std::move(run));
      }
    }
  }
  for (storage::StoredRun& run : request.files) {
    reader.Read(std::move(run));
  }
  request.files.clear();
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

bool Alarms(const std::shared_ptr<const ModelSet>& models,
            const LabelledEpisode& episode) {
  TrainingRun run;
  run.period_s = models->sample_period_s;
  run.flow_unit = models->flow_unit;
  run.samples = episode.samples;
  return std::ranges::any_of(ScoreRun(models, run), &Indication::detected);
}

void ReadEpisodes(const std::vector<storage::Episode>& episodes,
                  storage::HistoryReader& history,
                  const std::filesystem::path& runs, std::int64_t since_ns,
                  LabelPlan& labels) {
  LabelReader reader(history, runs, labels.parent, {}, {});
  for (const storage::Episode& episode : episodes) {
    if (episode.label == "false" && episode.detected_ns >= since_ns) {
      LabelledEpisode read = reader.Read(episode);
      (read.refusal.empty() ? labels.learnt : labels.refused)
          .push_back(std::move(read));
    }
  }
}

// The samples of false alarms: those read now, and those that the parent has
// learnt from and that cannot be read any more.
std::vector<storage::StoredRun> EvidenceOf(const LabelPlan& labels,
                                           const std::filesystem::path& runs) {
  std::vector<storage::StoredRun> evidence;
  for (const LabelledEpisode& episode : labels.learnt) {
    evidence.push_back(EvidenceOf(episode, *labels.parent));
  }
  for (const storage::TrainingEpisode& before : labels.lineage.episodes) {
    const bool read_now =
        std::ranges::any_of(labels.learnt, [&](const LabelledEpisode& now) {
          return now.meaning.episode_id == before.episode_id;
        });
    if (!read_now && before.fault == 0 && HasRun(labels.runs, before.run)) {
      evidence.push_back(storage::RunStore(runs).Load(before.run));
    }
  }
  return evidence;
}

// Sets the limits by all data; those that no person vouched for may not reach
// far beyond the limits of `first`.
void SetLimitsOf(LimitsPlan& plan, const ModelSet& first,
                 const std::vector<storage::StoredRun>& evidence) {
  const ModelSet& parent = plan.parent();
  if (plan.healthy.samples == 0 && evidence.empty()) {
    throw NotFoundError(
        "there are no healthy data of the valve (" +
        std::to_string(std::llround(plan.episodes_left_out_s)) +
        " s belong to episodes that are not labelled false): record them with "
        "fdi-monitor run --record, or name them with --runs or --file");
  }
  // Before the evidence of false alarms is added: a person has called those
  // samples healthy, so they may reach as far as they do.
  RequireHealthy(first, parent, PeaksOf(parent, plan.healthy));
  HealthyResiduals all = plan.healthy;
  for (const storage::StoredRun& run : evidence) {
    AddResiduals(plan.labels.parent, run, all);
  }
  plan.peaks = PeaksOf(parent, all);
  plan.limits = SetLimits(parent, all);
  plan.faults = CompareVisibility(parent, plan.limits.models, all.excerpt);
  RequireVisible(plan.faults);
  const auto now = std::make_shared<const ModelSet>(plan.limits.models);
  for (const LabelledEpisode& episode : plan.labels.learnt) {
    plan.false_alarms.push_back(
        {Alarms(plan.labels.parent, episode), Alarms(now, episode)});
  }
}

// The runs of the parent, but for evidence of episodes that have another label
// by now or whose samples are gone.
std::vector<std::string> RunsOfParent(
    const LabelPlan& labels, const std::vector<storage::Episode>& episodes,
    const std::filesystem::path& file) {
  std::vector<std::string> runs = labels.parent->training_runs;
  for (const storage::TrainingEpisode& before : labels.lineage.episodes) {
    // What labels have taught of faults is in the observers, which stay.
    if (before.fault != 0) {
      continue;
    }
    const auto now = std::ranges::find(episodes, before.episode_id,
                                       &storage::Episode::episode_id);
    if ((now != episodes.end() && now->label != "false") ||
        !IsStored(before.run, file)) {
      std::erase(runs, before.run);
    }
  }
  return runs;
}

}  // namespace

bool LimitsPlan::changes() const {
  return parent().floor != limits.models.floor ||
         !std::ranges::equal(LimitsOf(parent()), LimitsOf(limits.models), {},
                             &Limit::value, &Limit::value);
}

LimitsPlan MakeLimitsPlan(LimitsRequest request,
                          const storage::DataDirectory& directory) {
  LimitsPlan plan;
  ModelSet first;
  {
    storage::ModelStore store(directory.models());
    plan.labels.parent = OnboardedSet(request.valve, store);
    plan.labels.lineage =
        store.LineageOf({plan.parent().name, plan.parent().version});
    first = FirstSet(plan.parent(), store);
    plan.since_ns = request.since_ns.value_or(first.created_ns);
  }
  std::vector<storage::Episode> episodes;
  if (std::filesystem::exists(directory.history())) {
    storage::HistoryReader history(directory.history());
    episodes = EpisodesOf(request.valve, history);
    ReadEpisodes(episodes, history, directory.runs(), plan.since_ns,
                 plan.labels);
  }
  // The episodes come before the runs, because what is read of them is left out
  // there; the runs of the parent come before its evidence, because
  // EvidenceOf() takes only episodes whose label still holds.
  ReadRuns(request, directory.runs(),
           RunReader(plan, ExcludedSpans(episodes, plan.labels)),
           plan.since_ns);
  plan.labels.runs = RunsOfParent(plan.labels, episodes, directory.runs());
  SetLimitsOf(plan, first, EvidenceOf(plan.labels, directory.runs()));
  for (const std::string& run : plan.runs) {
    if (!HasRun(plan.labels.runs, run)) {
      plan.labels.runs.push_back(run);
    }
  }
  return plan;
}

ModelSet StoreLimits(LimitsPlan& plan, const std::string& valve,
                     const storage::DataDirectory& directory,
                     const std::string& software, std::int64_t created_ns) {
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  // The evidence is stored before the set that names its runs: a crash in
  // between leaves runs that no set names, not a set whose runs do not exist.
  if (!plan.labels.learnt.empty()) {
    StoreEvidence(plan.labels, directory, software);
  }
  ModelSet models = plan.limits.models;
  models.software = software;
  models.created_ns = created_ns;
  models.training_runs = plan.labels.runs;
  for (const LabelledEpisode& episode : plan.labels.learnt) {
    models.training_runs.push_back(episode.meaning.run);
  }
  storage::Lineage lineage = LineageOf(plan.labels);
  lineage.settings = nlohmann::json({{kLimits,
                                      {{"hours", plan.limits.hours},
                                       {"fitted", plan.limits.fitted},
                                       {"runs", plan.runs}}}})
                         .dump();
  models = store.Save(models, storage::Activation::kAlways, lineage);
  // AssignModelSet() alone would leave an onboarded valve without a baseline.
  // Only limits are new, so the record of the onboarding is repeated for the
  // new set.
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
