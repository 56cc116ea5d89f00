#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "storage/cli/program.h"
#include "storage/cli/progress.h"
#include "storage/cli/signal_list.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/time_text.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "storage/runs.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/file_runs.h"
#include "trainer/app/onboarding_report.h"
#include "trainer/app/run_input.h"
#include "trainer/app/valve_types.h"
#include "trainer/app/verbs.h"
#include "trainer/onboarding/signal_subset.h"

namespace fdi::trainer {
namespace {

struct OnboardOptions {
  std::string valve;
  std::vector<std::string> runs;
  std::vector<std::string> files;
  std::string type{"lublin-actuator-3"};
  std::string save_type;
  std::string name;
  std::vector<std::string> signals;
  double false_alarms_per_hour{1e-3};
  bool fit{true};
  bool assess{true};
  bool gains{false};
  int threads{0};
};

std::vector<TrainingRun> LoadRuns(const OnboardOptions& options,
                                  const storage::DataDirectory& directory) {
  if (options.runs.empty() && options.files.empty()) {
    throw ConfigError("healthy data are needed: --runs ID,... or --file CSV");
  }
  std::vector<storage::StoredRun> stored;
  if (!options.runs.empty()) {
    storage::RunStore store(directory.runs());
    for (const std::string& selector : options.runs) {
      stored.push_back(store.Load(selector));
    }
  }
  for (const std::string& file : options.files) {
    stored.push_back(ReadRunFile(
        file, std::nullopt,
        static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kX))));
  }
  std::vector<TrainingRun> runs;
  for (const storage::StoredRun& run : stored) {
    runs.push_back(ToTrainingRun(run, true));
    if (!options.signals.empty()) {
      runs.back() =
          WithSignals(std::move(runs.back()),
                      cli::ParseSignals(options.signals, kBasicSignals));
    }
  }
  return runs;
}

// The epoch of the valve; one that is not in the table yet is added.
std::uint32_t EpochOf(const std::string& valve, const Onboarding& onboarding,
                      storage::ModelStore& store) {
  for (const storage::ValveEntry& entry : store.Valves()) {
    if (entry.pattern == valve) {
      return entry.epoch;
    }
  }
  storage::ValveEntry entry;
  entry.pattern = valve;
  entry.type = onboarding.type.name;
  entry.flow_unit = onboarding.models.flow_unit;
  entry.signals = onboarding.signals;
  entry.period_s = onboarding.models.sample_period_s;
  store.PutValve(entry);
  return entry.epoch;
}

// Stops the work where the user asked to.
Progress Reporting(cli::Progress& bar, const cli::StopSignals& signals) {
  return [&](double share, std::string_view stage) {
    if (signals.stop_requested()) {
      throw Interrupted("interrupted: nothing was stored");
    }
    bar.Update(share, std::string(stage));
  };
}

void Store(const OnboardOptions& options, Onboarding& onboarding,
           storage::ModelStore& store) {
  onboarding.models =
      store.Save(onboarding.models, storage::Activation::kAlways);
  if (!options.save_type.empty()) {
    onboarding.type.name = options.save_type;
    SaveType(onboarding.type, store);
  }
  const std::uint32_t epoch = EpochOf(options.valve, onboarding, store);
  store.SetBaseline(options.valve, BaselineOf(onboarding, epoch));
}

int OnboardValve(const OnboardOptions& options, const cli::Context& context) {
  const storage::DataDirectory directory{context.options.data_dir};
  const std::vector<TrainingRun> runs = LoadRuns(options, directory);
  storage::EnsureExists(directory);
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  const FoundType found = FindType(options.type, store);
  OnboardingOptions settings;
  settings.name = options.name.empty() ? options.valve : options.name;
  settings.type = found.type;
  settings.fit = options.fit && !found.stored;
  settings.false_alarms_per_hour = options.false_alarms_per_hour;
  settings.threads = options.threads;
  settings.assess = options.assess;
  settings.software = context.software;
  settings.created_ns = cli::NowNs();
  const cli::StopSignals signals;
  cli::Progress bar("onboard");
  const auto start = std::chrono::steady_clock::now();
  Onboarding onboarding = Onboard(runs, settings, Reporting(bar, signals));
  if (options.gains && onboarding.coverage) {
    onboarding.coverage->gains =
        AssessType(onboarding.type, onboarding.coverage->signals, true,
                   settings, Reporting(bar, signals))
            .gains;
  }
  bar.Finish();
  Store(options, onboarding, store);
  if (context.options.json) {
    cli::PrintJson(std::cout, OnboardingJson(onboarding));
    return cli::kExitOk;
  }
  const std::chrono::duration<double> seconds =
      std::chrono::steady_clock::now() - start;
  std::cout << "valve " << options.valve << ": " << onboarding.hours
            << " h of healthy data, onboarded in "
            << std::lround(seconds.count()) << " s\n\n";
  PrintOnboarding(std::cout, onboarding);
  return cli::kExitOk;
}

void AddOptions(CLI::App& verb, OnboardOptions& options) {
  verb.add_option("--valve", options.valve, "Id that the set is assigned to")
      ->required()
      ->type_name("ID");
  verb.add_option("--runs", options.runs, "Healthy runs, or stretches [s]")
      ->delimiter(',')
      ->type_name("ID[@from:to],...");
  verb.add_option("--file", options.files,
                  "Healthy CSV file, not stored; repeatable")
      ->type_name("FILE.csv[@from:to]");
  verb.add_option("--type", options.type,
                  "Valve type: a stored one, whose fault effects are taken as "
                  "they are, or parameters that are fitted to the valve")
      ->type_name("NAME|FILE.toml")
      ->capture_default_str();
  verb.add_option("--save-type", options.save_type,
                  "Store what was fitted as a valve type for its like")
      ->type_name("NAME");
  verb.add_option("--name", options.name, "Of the model set; default: the id")
      ->type_name("NAME");
  verb.add_option("--signals", options.signals,
                  "Use these alone, as if the others were not measured")
      ->delimiter(',')
      ->type_name("CV,X,...");
  verb.add_option("--false-alarms-per-hour", options.false_alarms_per_hour,
                  "Rate that the thresholds are set for")
      ->check(CLI::Range(1e-9, 3600.0))
      ->type_name("R");
  verb.add_flag("!--no-fit", options.fit,
                "Take the parameters of the type as they are");
  verb.add_flag("!--no-coverage", options.assess, "Do not score every fault");
  verb.add_flag("--gains", options.gains,
                "Say what each transmitter that is missing would buy; takes "
                "the time of an onboarding for each");
  verb.add_option("--threads", options.threads, "0: all of the machine")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
}

}  // namespace

void AddOnboardVerb(cli::Program& program) {
  auto options = std::make_shared<OnboardOptions>();
  CLI::App& verb = program.AddVerb("onboard",
                                   "Make models for a valve that has only ever "
                                   "been healthy, and assign them",
                                   [options](const cli::Context& context) {
                                     return OnboardValve(*options, context);
                                   });
  AddOptions(verb, *options);
}

}  // namespace fdi::trainer
