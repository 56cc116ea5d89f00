#include "trainer/app/label_plan.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include "diagnosis/error.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "storage/runs.h"
#include "trainer/app/training_settings.h"

namespace fdi::trainer {
namespace {

using storage::TrainingEpisode;

std::map<std::string, double> ParseStrengths(
    const std::vector<std::string>& texts) {
  std::map<std::string, double> strengths;
  for (const std::string& text : texts) {
    const std::size_t sign = text.find('=');
    double strength = 0.0;
    const char* const end = text.data() + text.size();
    const bool good =
        sign != std::string::npos && sign > 0 &&
        std::from_chars(text.data() + sign + 1, end, strength).ptr == end &&
        strength != 0.0 && std::abs(strength) <= 1.0;
    if (!good) {
      throw ConfigError("--strength " + text +
                        ": accepted is EPISODE=S with the beginning of an "
                        "episode id and S in [-1, 1] without 0");
    }
    strengths[text.substr(0, sign)] = strength;
  }
  return strengths;
}

LabelSelection SelectionOf(const TrainOptions& options,
                           const cli::Context& context) {
  LabelSelection selection;
  selection.filter.valve_glob = options.valve;
  const std::int64_t now_ns = cli::NowNs();
  if (!options.since.empty()) {
    selection.filter.since_ns =
        cli::ParseTimeOrAgo(options.since, context.options.utc, now_ns);
  }
  if (!options.until.empty()) {
    selection.filter.until_ns =
        cli::ParseTimeOrAgo(options.until, context.options.utc, now_ns);
  }
  selection.strengths = ParseStrengths(options.strengths);
  return selection;
}

// --parent, or the one set that diagnosed the episodes.
std::string ParentOf(const TrainOptions& options,
                     const std::vector<storage::Episode>& episodes) {
  if (!options.parent.empty()) {
    return options.parent;
  }
  std::set<std::string> sets;
  for (const storage::Episode& episode : episodes) {
    sets.insert(episode.model_set);
  }
  if (sets.size() > 1) {
    throw ConfigError("the labelled episodes are of several model sets (" +
                      Joined({sets.begin(), sets.end()}) +
                      "): --parent NAME[@VERSION] says which to build on");
  }
  return *sets.begin();
}

void CheckStrengthsMeet(const LabelSelection& selection,
                        const std::vector<storage::Episode>& episodes) {
  for (const auto& [id, strength] : selection.strengths) {
    const auto meets = [&id = id](const storage::Episode& episode) {
      return episode.episode_id.starts_with(id);
    };
    if (std::none_of(episodes.begin(), episodes.end(), meets)) {
      throw NotFoundError("--strength " + id +
                          ": no labelled episode begins like that");
    }
  }
}

// The parent's runs less the evidence of episodes that are read anew.
void PlanRuns(const TrainOptions& options, const std::filesystem::path& file,
              LabelPlan& plan) {
  std::set<std::string> replaced;
  for (const TrainingEpisode& before : plan.lineage.episodes) {
    for (const LabelledEpisode& now : plan.learnt) {
      if (now.meaning.episode_id == before.episode_id) {
        replaced.insert(before.run);
      }
    }
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
  for (const std::string& run : options.runs) {
    store.Info(run);
    if (std::find(plan.runs.begin(), plan.runs.end(), run) == plan.runs.end()) {
      plan.runs.push_back(run);
    }
  }
}

TrainingOptions TrainingOf(const TrainOptions& options, const LabelPlan& plan) {
  TrainingOptions training = OptionsOf(*plan.parent, plan.lineage);
  training.name = options.name.empty() ? plan.parent->name : options.name;
  if (storage::ParseModelReference(training.name).version) {
    throw ConfigError("--name " + training.name +
                      ": the version is given when it is stored");
  }
  training.threads = options.threads;
  training.dataset.assume_normal |= options.assume_normal;
  training.false_alarms_per_hour =
      options.false_alarms_per_hour.value_or(training.false_alarms_per_hour);
  return training;
}

bool IsNew(const LabelledEpisode& episode, const storage::Lineage& lineage) {
  return std::none_of(lineage.episodes.begin(), lineage.episodes.end(),
                      [&](const TrainingEpisode& before) {
                        const TrainingEpisode& now = episode.meaning;
                        return before.episode_id == now.episode_id &&
                               before.fault == now.fault &&
                               before.strength == now.strength &&
                               before.samples == now.samples;
                      });
}

}  // namespace

std::string NameOf(const ModelSet& models) {
  return models.name + "@" + std::to_string(models.version);
}

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) {
    text += (text.empty() ? "" : ", ") + word;
  }
  return text;
}

LabelPlan MakeLabelPlan(const TrainOptions& options,
                        const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  const LabelSelection selection = SelectionOf(options, context);
  storage::HistoryReader history(directory.history());
  const auto episodes = FindLabelled(history, selection);
  if (episodes.empty()) {
    throw NotFoundError("no labelled episode of valve " + options.valve +
                        " in that time: see fdi-store history label");
  }
  CheckStrengthsMeet(selection, episodes);
  LabelPlan plan;
  storage::ModelStore models(directory.models());
  plan.parent = std::make_shared<const ModelSet>(
      models.Load(ParentOf(options, episodes)));
  plan.lineage = models.LineageOf({plan.parent->name, plan.parent->version});
  plan.training = TrainingOf(options, plan);
  LabelReader reader(history, directory.runs(), plan.parent,
                     plan.training.dataset, selection);
  for (const storage::Episode& episode : episodes) {
    LabelledEpisode read = reader.Read(episode);
    (read.refusal.empty() ? plan.learnt : plan.refused)
        .push_back(std::move(read));
  }
  PlanRuns(options, directory.runs(), plan);
  return plan;
}

std::string RefusalText(const LabelledEpisode& episode) {
  return "episode " + episode.meaning.episode_id + " of valve " +
         episode.meaning.valve_id + ", label " + episode.meaning.label + ": " +
         episode.refusal;
}

void RequireTrainable(const TrainOptions& options, const LabelPlan& plan) {
  if (!plan.missing.empty() && !options.drop_missing) {
    throw DataError(
        std::to_string(plan.missing.size()) + " of the " +
        std::to_string(plan.parent->training_runs.size()) + " runs that " +
        NameOf(*plan.parent) + " was trained on are not in runs.db: " +
        Joined(plan.missing) + "; --drop-missing does without them");
  }
  if (!plan.refused.empty() && !options.skip_refused) {
    std::string text;
    for (const LabelledEpisode& episode : plan.refused) {
      text += (text.empty() ? "" : "; ") + RefusalText(episode);
    }
    throw DataError(text + "; --skip-refused does without " +
                    (plan.refused.size() == 1 ? "it" : "them"));
  }
  const bool anything =
      !options.runs.empty() ||
      std::any_of(plan.learnt.begin(), plan.learnt.end(),
                  [&](const auto& e) { return IsNew(e, plan.lineage); });
  if (!anything) {
    throw DataError("nothing to learn: " + NameOf(*plan.parent) +
                    " has learnt from all of the labelled episodes that can "
                    "be used");
  }
}

}  // namespace fdi::trainer
