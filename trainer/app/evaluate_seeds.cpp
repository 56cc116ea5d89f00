#include <algorithm>
#include <iostream>
#include <mutex>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/cli/progress.h"
#include "storage/cli/stop_signals.h"
#include "storage/cli/text_table.h"
#include "trainer/app/campaign_runs.h"
#include "trainer/app/evaluate_options.h"
#include "trainer/app/rescore.h"
#include "trainer/app/seed_study.h"
#include "trainer/app/simulated_run.h"
#include "trainer/event_rate.h"
#include "trainer/parallel_for.h"
#include "trainer/wilson_interval.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

constexpr std::uint64_t kLeastSeedStep = 100;

// Scenarios of one repetition have seeds of their own, so those of the next
// begin behind them: at the next multiple of 100.
std::uint64_t SeedStep(std::size_t runs) {
  return (runs + kLeastSeedStep - 1) / kLeastSeedStep * kLeastSeedStep;
}

std::vector<CampaignRun> SimulatedScenarios(const EvaluateOptions& options,
                                            std::uint64_t offset) {
  std::vector<CampaignRun> runs =
      ValidationRuns(options.selection.campaign, offset);
  for (const CampaignRun& run : runs) {
    if (!std::holds_alternative<SimulatedRun>(run.source)) {
      throw ConfigError("--seeds repeats simulated runs; " + RunLabel(run) +
                        " of " + options.selection.campaign.string() +
                        " is not simulated");
    }
  }
  return runs;
}

// Simulates and scores all runs of all repetitions; none is stored.
std::vector<std::vector<EvaluatedRun>> Repeat(
    const EvaluateOptions& options,
    const std::shared_ptr<const ModelSet>& models) {
  const std::uint64_t first = options.selection.seed_offset;
  const std::size_t count = SimulatedScenarios(options, first).size();
  const auto seeds = static_cast<std::size_t>(options.seeds);
  std::vector<std::vector<CampaignRun>> scenarios;
  for (std::size_t s = 0; s < seeds; ++s) {
    scenarios.push_back(
        SimulatedScenarios(options, first + s * SeedStep(count)));
  }
  std::vector<std::vector<EvaluatedRun>> results(
      seeds, std::vector<EvaluatedRun>(count));
  const cli::StopSignals signals;
  cli::Progress progress("simulate");
  std::mutex mutex;
  int done = 0;
  const int total = static_cast<int>(seeds * count);
  ParallelFor(total, 0, [&](int i) {
    if (signals.stop_requested()) {
      throw Interrupted("interrupted");
    }
    const std::size_t s = static_cast<std::size_t>(i) / count;
    const std::size_t r = static_cast<std::size_t>(i) % count;
    const CampaignRun& run = scenarios[s][r];
    const ScoredRun scored{SimulateRun(std::get<SimulatedRun>(run.source)),
                           RunLabel(run), run.horizon_s};
    results[s][r] = Evaluated(scored, Rescore(models, scored.run), false);
    const std::scoped_lock lock(mutex);
    progress.Update(static_cast<double>(++done) / total, scored.name);
  });
  progress.Finish();
  return results;
}

// "0.98 [0.95, 0.99]"
std::string ShareText(int count, int runs) {
  const Interval interval = WilsonInterval(count, runs);
  return runs == 0 ? "-"
                   : FormatNumber(static_cast<double>(count) / runs, 3) + " [" +
                         FormatNumber(interval.low, 3) + ", " +
                         FormatNumber(interval.high, 3) + "]";
}

// "36.6 (36 to 37)": mean and range over the seeds.
std::string PerSeed(const SeedStudy& study, int SeedCounts::*field) {
  double sum = 0.0;
  int least = study.repetitions.front().*field;
  int most = least;
  for (const SeedCounts& counts : study.repetitions) {
    sum += counts.*field;
    least = std::min(least, counts.*field);
    most = std::max(most, counts.*field);
  }
  return FormatNumber(sum / static_cast<double>(study.repetitions.size()), 2) +
         " (" + std::to_string(least) + " to " + std::to_string(most) + ")";
}

void Print(std::ostream& out, const SeedStudy& study) {
  cli::TextTable table({{"fault"},
                        {"runs", Align::kRight},
                        {"detected [95 %]"},
                        {"set has the fault [95 %]"},
                        {"set is the fault [95 %]"}});
  const auto add = [&](const std::string& name, const SeedCounts& counts) {
    table.AddRow({name, std::to_string(counts.runs),
                  ShareText(counts.detected, counts.runs),
                  ShareText(counts.contained, counts.runs),
                  ShareText(counts.exact, counts.runs)});
  };
  for (const SeedCounts& counts : study.faults) {
    add(FaultName(counts.fault), counts);
  }
  add("all", study.total);
  table.AddRow({"per seed", std::to_string(study.repetitions.front().runs),
                PerSeed(study, &SeedCounts::detected),
                PerSeed(study, &SeedCounts::contained),
                PerSeed(study, &SeedCounts::exact)});
  table.Print(out);
  out << "\nalarms before the fault: " << study.runs_with_false_alarm << " of "
      << study.total.runs << " runs, largest r_fd "
      << FormatNumber(std::max(0.0, study.max_r_fd), 4)
      << "\nepisodes without fault: " << study.fault_free_episodes << " in "
      << FormatNumber(study.fault_free_hours, 2) << " h";
  if (study.fault_free_hours > 0.0) {
    out << "; per valve-year below "
        << FormatNumber(
               RateOf(study.fault_free_episodes, study.fault_free_hours).upper,
               1)
        << " (95 %)";
  }
  out << '\n';
}

cli::Json ShareJson(int count, int runs) {
  const Interval interval = WilsonInterval(count, runs);
  return {{"count", count}, {"low", interval.low}, {"high", interval.high}};
}

cli::Json JsonOf(const SeedCounts& counts) {
  return {{"runs", counts.runs},
          {"detected", ShareJson(counts.detected, counts.runs)},
          {"contained", ShareJson(counts.contained, counts.runs)},
          {"exact", ShareJson(counts.exact, counts.runs)}};
}

cli::Json JsonOf(const SeedStudy& study, const Detector& detector) {
  cli::Json json = DetectorJson(detector);
  json["seeds"] = study.repetitions.size();
  json["faults"] = cli::Json::object();
  for (const SeedCounts& counts : study.faults) {
    json["faults"][FaultName(counts.fault)] = JsonOf(counts);
  }
  json["total"] = JsonOf(study.total);
  json["runs_with_false_alarm"] = study.runs_with_false_alarm;
  json["max_r_fd"] = study.max_r_fd;
  json["fault_free_episodes"] = study.fault_free_episodes;
  json["fault_free_hours"] = study.fault_free_hours;
  return json;
}

}  // namespace

int EvaluateSeeds(const EvaluateOptions& options, const cli::Context& context) {
  const auto models = LoadModels(options, context);
  const SeedStudy study = StudySeeds(Repeat(options, models));
  if (context.options.json) {
    cli::PrintJson(std::cout, JsonOf(study, DetectorOf(*models)));
  } else {
    Print(std::cout, study);
  }
  return cli::kExitOk;
}

}  // namespace fdi::trainer
