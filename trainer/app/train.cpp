#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/cli/lineage_text.h"
#include "storage/cli/logging.h"
#include "storage/cli/program.h"
#include "storage/cli/progress.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "storage/runs.h"
#include "trainer/app/campaign.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/model_report.h"
#include "trainer/app/run_input.h"
#include "trainer/app/train_options.h"
#include "trainer/app/training_settings.h"
#include "trainer/app/verbs.h"

namespace fdi::trainer {
namespace {

// What is of --from-labels alone, and what does not go with it.
void CheckOptions(const TrainOptions& options) {
  const std::pair<bool, const char*> of_labels[] = {
      {!options.parent.empty(), "--parent"},
      {options.valve != "*", "--valve"},
      {!options.since.empty(), "--since"},
      {!options.until.empty(), "--until"},
      {!options.strengths.empty(), "--strength"},
      {options.drop_missing, "--drop-missing"},
      {options.skip_refused, "--skip-refused"},
      {options.dry_run, "--dry-run"}};
  for (const auto& [given, name] : of_labels) {
    if (given && !options.from_labels) {
      throw ConfigError(std::string(name) + " is of --from-labels");
    }
  }
  if (options.from_labels && options.print_campaign) {
    throw ConfigError(
        "--print-campaign: with --from-labels, --dry-run says what would be "
        "done");
  }
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
  TrainingOptions& training = campaign.training;
  training.name = options.name.empty() ? training.name : options.name;
  training.threads = options.threads;
  training.dataset.assume_normal |= options.assume_normal;
  training.false_alarms_per_hour =
      options.false_alarms_per_hour.value_or(training.false_alarms_per_hour);
  if (training.name.empty()) {
    throw ConfigError("the model set needs a name: --name NAME");
  }
  if (storage::ParseModelReference(training.name).version) {
    throw ConfigError("--name " + training.name +
                      ": the version is given when it is stored");
  }
  return campaign;
}

void RequireGoOn(const cli::StopSignals& signals) {
  if (signals.stop_requested()) {
    throw Interrupted("interrupted: no model set was stored");
  }
}

CollectedRuns Collect(const Campaign& campaign, const cli::Context& context,
                      const cli::StopSignals& signals) {
  const storage::DataDirectory directory{context.options.data_dir};
  std::optional<cli::Progress> progress;
  CollectedRuns collected =
      CollectRuns(campaign.runs, directory,
                  {context.software, cli::NowNs(), campaign.training.threads},
                  [&](double share, const std::string& what) {
                    RequireGoOn(signals);
                    if (!progress) {
                      progress.emplace("simulate");
                    }
                    progress->Update(share, what);
                  });
  if (progress) {
    progress->Finish();
  }
  context.log(
      LogLevel::kInfo,
      cli::EventLine("runs_collected",
                     {{"runs", std::to_string(collected.selectors.size())},
                      {"simulated", std::to_string(collected.simulated)},
                      {"imported", std::to_string(collected.imported)},
                      {"reused", std::to_string(collected.reused)}}));
  return collected;
}

int Train(const TrainOptions& options, const cli::Context& context) {
  CheckOptions(options);
  if (options.from_labels) {
    return TrainFromLabels(options, context);
  }
  Campaign campaign = MakeCampaign(options);
  if (options.print_campaign) {
    std::cout << CampaignText(campaign);
    return cli::kExitOk;
  }
  const cli::StopSignals signals;
  const CollectedRuns collected = Collect(campaign, context, signals);
  const storage::DataDirectory directory{context.options.data_dir};
  const std::vector<TrainingRun> runs =
      LoadTrainingRuns(collected.selectors, directory.runs(),
                       campaign.training.dataset.assume_normal);
  PrintTrained(
      TrainAndStore(runs, campaign.training, options, {}, signals, context),
      context);
  return cli::kExitOk;
}

CLI::Option* AddLabelOptions(CLI::App& verb, TrainOptions& options) {
  CLI::Option* labels = verb.add_flag(
      "--from-labels", options.from_labels,
      "The next version of a set from what its episodes were labelled, "
      "together with the runs that it was trained on, and --runs");
  verb.add_option("--parent", options.parent,
                  "The set to build on; default: that of the episodes")
      ->type_name("NAME[@VERSION]");
  verb.add_option("--valve", options.valve, "Episodes of valves like GLOB")
      ->type_name("GLOB");
  verb.add_option("--since", options.since,
                  "Episodes detected since: RFC 3339, or a duration ago (30d)")
      ->type_name("TIME");
  verb.add_option("--until", options.until, "Episodes detected until")
      ->type_name("TIME");
  verb.add_option("--strength", options.strengths,
                  "Of the fault of an episode, where no estimate is right")
      ->delimiter(',')
      ->type_name("EPISODE=S,...");
  verb.add_flag("--drop-missing", options.drop_missing,
                "Do without runs of the parent that are gone");
  verb.add_flag("--skip-refused", options.skip_refused,
                "Do without labelled episodes that cannot be used");
  verb.add_flag("--dry-run", options.dry_run,
                "Say what would be trained on and exit")
      ->configurable(false);
  return labels;
}

void AddOptions(CLI::App& verb, TrainOptions& options) {
  CLI::Option* runs =
      verb.add_option("--runs", options.runs, "Runs, or stretches of them [s]")
          ->delimiter(',')
          ->type_name("ID[@from:to],...");
  CLI::Option* preset =
      verb.add_option("--preset", options.preset, "paper or extended")
          ->type_name("NAME");
  CLI::Option* campaign =
      verb.add_option("--campaign", options.campaign,
                      "Settings and runs; simulates or imports what is missing")
          ->type_name("FILE.toml")
          ->excludes(runs)
          ->excludes(preset);
  verb.add_option("--name", options.name,
                  "Of the model set; overrides the campaign's")
      ->type_name("NAME");
  verb.add_flag("--assume-normal", options.assume_normal,
                "What has no truth counts as free of faults");
  verb.add_option("--false-alarms-per-hour", options.false_alarms_per_hour,
                  "Rate that the thresholds are set for")
      ->check(CLI::Range(1e-9, 3600.0))
      ->type_name("R");
  verb.add_option("--threads", options.threads, "0: all of the machine")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  verb.add_flag("--activate", options.activate,
                "Make this version the active one; otherwise only the first "
                "version of a name becomes active");
  verb.add_flag("--print-campaign", options.print_campaign,
                "Print what would be done as a campaign and exit")
      ->configurable(false);
  AddLabelOptions(verb, options)->excludes(campaign)->excludes(preset);
}

}  // namespace

std::vector<TrainingRun> LoadTrainingRuns(
    const std::vector<std::string>& selectors,
    const std::filesystem::path& runs, bool assume_normal) {
  storage::RunStore store(runs);
  std::vector<TrainingRun> loaded;
  for (const std::string& selector : selectors) {
    loaded.push_back(ToTrainingRun(store.Load(selector), assume_normal));
  }
  return loaded;
}

storage::ModelReference TrainAndStore(const std::vector<TrainingRun>& runs,
                                      const TrainingOptions& training,
                                      const TrainOptions& options,
                                      storage::Lineage lineage,
                                      const cli::StopSignals& signals,
                                      const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  TrainingOptions stamped = training;
  stamped.software = context.software;
  stamped.created_ns = cli::NowNs();
  lineage.settings = SettingsText(training);
  cli::Progress progress("train");
  const ModelSet models =
      TrainModelSet(runs, stamped, [&](double share, std::string_view stage) {
        RequireGoOn(signals);
        progress.Update(share, std::string(stage));
      });
  RequireGoOn(signals);
  progress.Finish();
  const ModelSet saved =
      store.Save(models,
                 options.activate ? storage::Activation::kAlways
                                  : storage::Activation::kIfFirst,
                 lineage);
  return {saved.name, saved.version};
}

void PrintTrained(const storage::ModelReference& reference,
                  const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models());
  const ModelSet models = store.Load(reference);
  const storage::Lineage lineage = store.LineageOf(reference);
  if (context.options.json) {
    cli::Json json = ModelsJson(models);
    if (lineage.parent) {
      json["lineage"] = cli::LineageJson(lineage);
    }
    cli::PrintJson(std::cout, json);
    return;
  }
  std::cout << "model set " << models.name << '@' << models.version << ", hash "
            << HashText(models.content_hash) << "\n";
  if (lineage.parent) {
    std::cout << "built on " << cli::ParentText(lineage) << "\n\n";
    cli::PrintEpisodes(std::cout, lineage, context.options.utc);
  }
  std::cout << '\n';
  PrintModels(std::cout, models);
}

void AddTrainVerb(cli::Program& program) {
  auto options = std::make_shared<TrainOptions>();
  CLI::App& verb = program.AddVerb(
      "train", "Train a model set and store it as the next version of its name",
      [options](const cli::Context& context) {
        return Train(*options, context);
      });
  AddOptions(verb, *options);
}

}  // namespace fdi::trainer
