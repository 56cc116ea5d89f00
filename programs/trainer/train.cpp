// fdi-trainer train: from stored runs, from a campaign, which simulates or
// imports what is missing, or from what people have labelled. A list of runs is
// a campaign in memory, so that both are trained in one way.
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/teach.h"
#include "programs/trainer/verbs.h"
#include "report/models/lineage_text.h"
#include "report/program.h"
#include "report/progress.h"
#include "report/report.h"
#include "report/stop_signals.h"
#include "report/verb_options.h"
#include "storage/database/data_directory.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/campaign.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/learning/label_plan.h"

namespace fdi::trainer {
namespace {

using report::Json;

struct TrainOptions {
  std::string name;
  std::string preset{"paper"};
  std::vector<std::string> runs;
  std::filesystem::path campaign;
  bool assume_normal{false};
  std::optional<double> false_alarms_per_hour;
  int threads{0};
  bool activate{false};
  bool print_campaign{false};

  bool from_labels{false};
  std::string parent;  ///< NAME[@VERSION]; empty: that of the episodes.
  std::string valve{"*"};
  report::TimeWindow detected;
  std::vector<std::string> strengths;  ///< EPISODE=S
  bool drop_missing{false};
  bool skip_refused{false};
  std::string type;  ///< That gets what an onboarded valve has learnt.
  bool dry_run{false};
};

// Lays what the command line says over the settings of a campaign or parent.
void Override(const TrainOptions& options, TrainingOptions& training) {
  training.name = options.name.empty() ? training.name : options.name;
  training.threads = options.threads;
  training.dataset.assume_normal |= options.assume_normal;
  training.false_alarms_per_hour =
      options.false_alarms_per_hour.value_or(training.false_alarms_per_hour);
  if (training.name.empty()) {
    throw ConfigError("the model set needs a name: --name NAME");
  }
  RequireStorable(training.name, "--name");
}

// `train --runs` is a campaign in memory.
Campaign MakeCampaign(const TrainOptions& options) {
  if (options.campaign.empty() == options.runs.empty()) {
    throw ConfigError(
        "either --runs ID,..., --campaign FILE.toml or --from-labels");
  }
  Campaign campaign;
  if (!options.campaign.empty()) {
    campaign = LoadCampaign(options.campaign);
    if (campaign.runs.empty()) {
      throw ConfigError(options.campaign.string() +
                        ": there is no [[run]] to train on");
    }
  } else {
    campaign.training = PresetOptions(options.preset);
    for (const std::string& run : options.runs) {
      storage::ParseRunSelector(run);
      campaign.runs.push_back({RecordedRun{run}, {}, 0.0});
    }
  }
  Override(options, campaign.training);
  return campaign;
}

// Ctrl-C is answered within a second, whatever step the work is at: what is in
// the files is whole after any end.
constexpr std::chrono::milliseconds kTrainPatience{800};
constexpr const char* kLastWords =
    "\nfdi-trainer: error: interrupted: no model set was stored\n";

void ThrowIfStopped(const report::StopSignals& signals) {
  if (signals.stop_requested()) {
    throw Interrupted("interrupted: no model set was stored");
  }
}

std::vector<std::string> Collect(const Campaign& campaign,
                                 const report::Context& context,
                                 const report::StopSignals& signals) {
  const storage::DataDirectory directory{context.options.data_dir};
  std::optional<report::Progress> progress;  // Only if something is simulated.
  CollectedRuns collected =
      CollectRuns(campaign.runs, directory,
                  {context.software, NowNs(), campaign.training.threads},
                  [&](double share, const std::string& what) {
                    ThrowIfStopped(signals);
                    if (!progress) {
                      progress.emplace("simulate");
                    }
                    progress->Update(share, what);
                  });
  if (progress) {
    progress->Finish();
  }
  context.log(LogLevel::kInfo,
              EventLine("runs_collected",
                        {{"runs", std::to_string(collected.selectors.size())},
                         {"simulated", std::to_string(collected.simulated)},
                         {"imported", std::to_string(collected.imported)},
                         {"reused", std::to_string(collected.reused)}}));
  return std::move(collected.selectors);
}

std::vector<TrainingRun> LoadTrainingRuns(
    const std::vector<std::string>& selectors,
    const storage::DataDirectory& directory, bool assume_normal) {
  storage::RunStore store(directory.runs());
  std::vector<TrainingRun> runs;
  for (const std::string& selector : selectors) {
    runs.push_back(ToTrainingRun(store.Load(selector), assume_normal));
  }
  return runs;
}

// Trains, stores the set unless that fails or is interrupted, and shows it.
report::Report TrainAndStore(const std::vector<TrainingRun>& runs,
                             TrainingOptions training, bool activate,
                             storage::Lineage lineage,
                             report::StopSignals& signals,
                             const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  // Opened first: a database that cannot be written costs no training.
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  lineage.settings = SettingsText(training);
  training.software = context.software;
  training.created_ns = NowNs();
  report::Progress progress("train");
  const ModelSet trained =
      TrainModelSet(runs, training, [&](double share, std::string_view stage) {
        ThrowIfStopped(signals);
        progress.Update(share, std::string(stage));
      });
  ThrowIfStopped(signals);
  signals.EndWithin(std::chrono::milliseconds(0));
  progress.Finish();
  const ModelSet models = store.Save(
      trained,
      activate ? storage::Activation::kAlways : storage::Activation::kIfFirst,
      lineage);
  report::Report report;
  report.document = ModelsJson(models);
  report.Line("model set " + NameOf(models) + ", hash " +
              storage::HashHex(models.content_hash));
  if (lineage.parent) {
    report.document["lineage"] =
        report::LineageJson(store.LineageOf({models.name, models.version}));
    report.Line("built on " + report::ParentText(lineage) + "\n");
    AddEpisodeTable(report);
  }
  report.Line("");
  AddModelTables(models, report);
  return report;
}

// Strengths by the begin of an episode id. 0 is refused: that there was no
// fault is said by the label `false`.
GivenStrengths ParseStrengths(const std::vector<std::string>& texts) {
  GivenStrengths strengths;
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

Json EpisodeJson(const LabelledEpisode& episode) {
  const storage::TrainingEpisode& meaning = episode.meaning;
  const bool used = episode.refusal.empty();
  return {{"episode_id", meaning.episode_id},
          {"valve_id", meaning.valve_id},
          {"label", meaning.label},
          {"labelled_by", meaning.labelled_by},
          {"fault", used ? Json(FaultName(meaning.fault)) : Json()},
          {"strength", used ? Json(meaning.strength) : Json()},
          {"samples", meaning.samples},
          {"data", episode.data},
          {"refused", used ? Json() : Json(episode.refusal)}};
}

report::Report PlanReport(const LabelPlan& plan) {
  const std::string parent = NameOf(*plan.parent);
  report::Report report;
  report.document = {
      {"model_set", plan.training.name},
      {"parent", parent},
      {"parent_hash", storage::HashHex(plan.parent->content_hash)},
      {"runs", plan.runs},
      {"missing_runs", plan.missing},
      {"episodes", Json::array()}};
  for (const auto* list : {&plan.learnt, &plan.refused}) {
    for (const LabelledEpisode& episode : *list) {
      report.document["episodes"].push_back(EpisodeJson(episode));
    }
  }
  report.Line("next version of " + plan.training.name + ", built on " + parent +
              "\nruns: " + JoinText(plan.runs));
  if (!plan.missing.empty()) {
    report.Line("not in runs.db: " + JoinText(plan.missing));
  }
  report.Line("").Table("episodes", {{"episode", "episode_id"},
                                     {"valve", "valve_id"},
                                     {"label", "label"},
                                     {"by", "labelled_by"},
                                     {"taken as", "fault"},
                                     StrengthColumn(),
                                     {"samples", "samples"},
                                     {"data", "data"},
                                     {"refused because", "refused"}});
  return report;
}

// A set of onboarding has no settings of a training.
void CheckTeaching(const TrainOptions& options, const ModelSet& parent) {
  const bool renamed = !options.name.empty() && options.name != parent.name;
  if (renamed || options.false_alarms_per_hour || options.assume_normal) {
    throw ConfigError(
        "--name, --false-alarms-per-hour and --assume-normal are for sets of "
        "fdi-trainer train: " +
        NameOf(parent) +
        " was made by onboarding, and gets observers of what labels name");
  }
}

// What the plan shows to be wrong is refused before the evidence of the labels
// is stored. A set of onboarding then gets further observers (TeachAndStore);
// any other is trained anew on its own runs and on that evidence.
report::Report TrainFromLabels(const TrainOptions& options,
                               const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  LabelRequest request;
  request.parent = options.parent;
  request.filter.valve_glob = options.valve;
  request.filter.since_ns = options.detected.since_ns(context);
  request.filter.until_ns = options.detected.until_ns(context);
  request.strengths = ParseStrengths(options.strengths);
  request.runs = options.runs;
  LabelPlan plan = MakeLabelPlan(request, directory);
  const bool onboarded = IsOnboarded(*plan.parent);
  if (onboarded) {
    CheckTeaching(options, *plan.parent);
  } else if (!options.type.empty()) {
    throw ConfigError("--type is for sets of fdi-trainer onboard, " +
                      NameOf(*plan.parent) + " is none");
  }
  Override(options, plan.training);
  if (options.dry_run) {
    return PlanReport(plan);
  }
  RequireTrainable(plan, options.drop_missing, options.skip_refused);
  report::StopSignals signals;
  signals.EndWithin(kTrainPatience, kLastWords);
  for (const LabelledEpisode& episode : plan.refused) {
    context.log(
        LogLevel::kWarning,
        EventLine("episode_refused", {{"reason", RefusalText(episode)}}));
  }
  const int stored = StoreEvidence(plan, directory, context.software);
  context.log(LogLevel::kInfo,
              EventLine("labels_read",
                        {{"episodes", std::to_string(plan.learnt.size())},
                         {"refused", std::to_string(plan.refused.size())},
                         {"runs_stored", std::to_string(stored)}}));
  if (onboarded) {
    return TeachAndStore(plan, {options.type, options.activate}, signals,
                         context);
  }
  std::vector<std::string> selectors = plan.runs;
  for (const LabelledEpisode& episode : plan.learnt) {
    selectors.push_back(episode.meaning.run);
  }
  std::vector<TrainingRun> runs = LoadTrainingRuns(
      selectors, directory, plan.training.dataset.assume_normal);
  RestrictToCommonSignals(*plan.parent, runs);
  return TrainAndStore(runs, plan.training, options.activate, LineageOf(plan),
                       signals, context);
}

report::Report Train(const TrainOptions& options,
                     const report::Context& context) {
  if (options.from_labels) {
    return TrainFromLabels(options, context);
  }
  const Campaign campaign = MakeCampaign(options);
  if (options.print_campaign) {
    report::Report report;
    std::string text = CampaignText(campaign);
    text.pop_back();  // The line ends by itself.
    report.document["campaign"] = text;
    report.Line(text);
    return report;
  }
  report::StopSignals signals;
  signals.EndWithin(kTrainPatience, kLastWords);
  const std::vector<TrainingRun> runs = LoadTrainingRuns(
      Collect(campaign, context, signals), {context.options.data_dir},
      campaign.training.dataset.assume_normal);
  return TrainAndStore(runs, campaign.training, options.activate, {}, signals,
                       context);
}

void AddOptions(CLI::App& verb, TrainOptions& options) {
  CLI::Option* runs = verb.add_option("--runs", options.runs,
                                      "Stored runs, or stretches of them [s]")
                          ->delimiter(',')
                          ->type_name("ID[@from:to],...");
  CLI::Option* preset = verb.add_option("--preset", options.preset,
                                        "Training settings to begin with")
                            ->type_name("paper|extended");
  CLI::Option* campaign =
      verb.add_option("--campaign", options.campaign,
                      "Settings and runs; simulates or imports what is missing")
          ->type_name("FILE.toml")
          ->excludes(runs)
          ->excludes(preset);
  verb.add_option("--name", options.name,
                  "Name of the model set, instead of the campaign's")
      ->type_name("NAME");
  verb.add_flag("--assume-normal", options.assume_normal,
                "Count samples without truth as free of faults");
  verb.add_option("--false-alarms-per-hour", options.false_alarms_per_hour,
                  "Rate that the thresholds are set for")
      ->check(CLI::Range(1e-9, 3600.0))
      ->type_name("R");
  verb.add_option("--threads", options.threads,
                  "Number of threads; 0 uses all cores")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  verb.add_flag("--activate", options.activate,
                "Make this version the active one; otherwise only the first "
                "version of a name becomes active");
  CLI::Option* print =
      verb.add_flag("--print-campaign", options.print_campaign,
                    "Print the settings and runs as a campaign and exit")
          ->configurable(false);
  verb.add_flag("--from-labels", options.from_labels,
                "Train the next version of a set on the episodes that people "
                "labelled, together with the runs that it was trained on and "
                "--runs")
      ->excludes(campaign)
      ->excludes(preset)
      ->excludes(print);
}

// These make sense with --from-labels alone.
void AddLabelOptions(CLI::App& verb, TrainOptions& options) {
  options.detected.AddTo(verb);
  verb.add_option("--parent", options.parent,
                  "The set to build on (default: that of the episodes)")
      ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve, "Episodes of matching valves only")
      ->type_name("GLOB");
  verb.add_option("--strength", options.strengths,
                  "Strength of the fault of an episode, instead of the "
                  "estimate")
      ->delimiter(',')
      ->type_name("EPISODE=S,...");
  verb.add_option("--type", options.type,
                  "Valve type that was saved with the parent, a set of "
                  "onboarding: valves onboarded later get the new observers")
      ->type_name("NAME");
  verb.add_flag("--drop-missing", options.drop_missing,
                "Train without runs of the parent that are gone");
  verb.add_flag("--skip-refused", options.skip_refused,
                "Train without labelled episodes that cannot be used");
  verb.add_flag("--dry-run", options.dry_run,
                "Show what the set would be trained on and exit")
      ->configurable(false);
  for (const char* name :
       {"--since", "--until", "--parent", "--valve", "--strength",
        "--drop-missing", "--skip-refused", "--dry-run"}) {
    verb.get_option(name)->needs("--from-labels");
  }
}

}  // namespace

void AddTrainVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "train",
      "Train a model set and store it as the next version of its name", Train);
  AddOptions(verb, options);
  AddLabelOptions(verb, options);
  program.AddExamples(
      {{"train",
        {{"The paper's observers, simulating what they are trained on",
          "fdi-trainer train --campaign campaigns/paper.toml"},
         {"From stored runs",
          "fdi-trainer train --name unit1 --preset extended --runs "
          "1a2b,3c4d@0:3600"},
         {"The next version, from what episodes were labelled",
          "fdi-trainer train --from-labels --since 30d"}}}});
}

}  // namespace fdi::trainer
