#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
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
#include "trainer/app/verbs.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

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
};

// `train --runs` is a campaign in memory.
Campaign MakeCampaign(const TrainOptions& options) {
  if (options.campaign.empty() == options.runs.empty()) {
    throw ConfigError("either --runs ID,... or --campaign FILE.toml");
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

std::vector<TrainingRun> LoadRuns(const std::vector<std::string>& selectors,
                                  const storage::DataDirectory& directory,
                                  bool assume_normal) {
  storage::RunStore store(directory.runs());
  std::vector<TrainingRun> runs;
  for (const std::string& selector : selectors) {
    runs.push_back(ToTrainingRun(store.Load(selector), assume_normal));
  }
  return runs;
}

ModelSet TrainAndStore(Campaign& campaign, const TrainOptions& options,
                       const cli::Context& context) {
  const cli::StopSignals signals;
  const CollectedRuns collected = Collect(campaign, context, signals);
  const storage::DataDirectory directory{context.options.data_dir};
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  campaign.training.software = context.software;
  campaign.training.created_ns = cli::NowNs();
  cli::Progress progress("train");
  const ModelSet models = TrainModelSet(
      LoadRuns(collected.selectors, directory,
               campaign.training.dataset.assume_normal),
      campaign.training, [&](double share, std::string_view stage) {
        RequireGoOn(signals);
        progress.Update(share, std::string(stage));
      });
  RequireGoOn(signals);
  progress.Finish();
  return store.Save(models, options.activate ? storage::Activation::kAlways
                                             : storage::Activation::kIfFirst);
}

int Train(const TrainOptions& options, const cli::Context& context) {
  Campaign campaign = MakeCampaign(options);
  if (options.print_campaign) {
    std::cout << CampaignText(campaign);
    return cli::kExitOk;
  }
  const ModelSet models = TrainAndStore(campaign, options, context);
  if (context.options.json) {
    cli::PrintJson(std::cout, ModelsJson(models));
    return cli::kExitOk;
  }
  std::cout << "model set " << models.name << '@' << models.version << ", hash "
            << HashText(models.content_hash) << "\n\n";
  PrintModels(std::cout, models);
  return cli::kExitOk;
}

void AddOptions(CLI::App& verb, TrainOptions& options) {
  CLI::Option* runs =
      verb.add_option("--runs", options.runs, "Runs, or stretches of them [s]")
          ->delimiter(',')
          ->type_name("ID[@from:to],...");
  CLI::Option* preset =
      verb.add_option("--preset", options.preset, "paper or extended")
          ->type_name("NAME");
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
}

}  // namespace

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
