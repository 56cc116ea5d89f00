#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/cli/program.h"
#include "storage/cli/progress.h"
#include "storage/cli/signal_list.h"
#include "storage/cli/stop_signals.h"
#include "storage/data_directory.h"
#include "storage/models.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/onboarding_report.h"
#include "trainer/app/valve_types.h"
#include "trainer/app/verbs.h"

namespace fdi::trainer {
namespace {

struct CoverageOptions {
  std::vector<std::string> signals;
  std::string type{"lublin-actuator-3"};
  bool gains{true};
  int threads{0};
};

int Assess(const CoverageOptions& options, const cli::Context& context) {
  const SignalMask signals = cli::ParseSignals(options.signals, kBasicSignals);
  const storage::DataDirectory directory{context.options.data_dir};
  storage::EnsureExists(directory);
  storage::ModelStore store(directory.models(),
                            storage::Access::kOccasionalWriter);
  OnboardingOptions settings;
  settings.name = "coverage";
  settings.threads = options.threads;
  const cli::StopSignals stop;
  cli::Progress bar("coverage");
  const CoverageTable table =
      AssessType(FindType(options.type, store).type, signals, options.gains,
                 settings, [&](double share, std::string_view stage) {
                   if (stop.stop_requested()) {
                     throw Interrupted("interrupted");
                   }
                   bar.Update(share, std::string(stage));
                 });
  bar.Finish();
  if (context.options.json) {
    cli::PrintJson(std::cout, CoverageJson(table));
  } else {
    PrintCoverage(std::cout, table);
  }
  return cli::kExitOk;
}

}  // namespace

void AddCoverageVerb(cli::Program& program) {
  auto options = std::make_shared<CoverageOptions>();
  CLI::App& verb = program.AddVerb(
      "coverage",
      "Say which faults a valve type would show with some transmitters",
      [options](const cli::Context& context) {
        return Assess(*options, context);
      });
  verb.add_option("--signals", options->signals, "What the valve measures")
      ->required()
      ->delimiter(',')
      ->type_name("CV,X,...");
  verb.add_option("--type", options->type, "Valve type")
      ->type_name("NAME|FILE.toml")
      ->capture_default_str();
  verb.add_flag("!--no-gains", options->gains,
                "Leave out what one more transmitter would buy");
  verb.add_option("--threads", options->threads, "0: all of the machine")
      ->check(CLI::Range(0, 1024))
      ->type_name("N");
}

}  // namespace fdi::trainer
