// fdi-trainer train: from stored runs, or from a campaign, which simulates or
// imports what is missing. A list of runs is a campaign in memory, so that both
// are trained in one way.
#include <chrono>
#include <optional>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "base/time_text.h"
#include "programs/trainer/model_report.h"
#include "programs/trainer/verbs.h"
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
};

// Lays what the command line says over the settings of a campaign.
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
                             report::StopSignals& signals,
                             const report::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  // Opened first: a database that cannot be written costs no training.
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  storage::Lineage lineage;
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
              Hex16(models.content_hash));
  report.Line("");
  AddModelTables(models, report);
  return report;
}

report::Report Train(const TrainOptions& options,
                     const report::Context& context) {
  const Campaign campaign = MakeCampaign(options);
  report::StopSignals signals;
  signals.EndWithin(kTrainPatience, kLastWords);
  const std::vector<TrainingRun> runs = LoadTrainingRuns(
      Collect(campaign, context, signals), {context.options.data_dir},
      campaign.training.dataset.assume_normal);
  return TrainAndStore(runs, campaign.training, options.activate, signals,
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
  verb.add_option("--jobs", options.threads,
                  "Number of threads; 0: one per core")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
  verb.add_flag("--activate", options.activate,
                "Make this version the active one; otherwise only the first "
                "version of a name becomes active");
}

}  // namespace

void AddTrainVerb(report::Program& program) {
  auto [verb, options] = AddVerb(
      program, "train",
      "Train a model set and store it as the next version of its name", Train);
  AddOptions(verb, options);
  program.AddExamples(
      {{"train",
        {{"The paper's observers, simulating what they are trained on",
          "fdi-trainer train --campaign campaigns/paper.toml"},
         {"From stored runs",
          "fdi-trainer train --name unit1 --preset extended --runs "
          "1a2b,3c4d@0:3600"}}}});
}

}  // namespace fdi::trainer
