#include "trainer/onboarding/onboarding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/parallel_for.h"
#include "diagnosis/model/fault_catalogue.h"
#include "simulator/fault_effects.h"
#include "simulator/record_fit.h"
#include "simulator/second_look/valve_physics.h"
#include "simulator/valve_equations.h"
#include "trainer/onboarding/lost_command.h"
#include "trainer/onboarding/record_checks.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr std::uint64_t kSeed = 1;

std::string SignalList(SignalMask signals) {
  std::string list;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      list += (list.empty() ? "" : ", ") + std::string(SignalName(signal));
    }
  }
  return list.empty() ? "none" : list;
}

// Keeps the regressors that `signals` has.
void Restrict(SignalMask signals, std::vector<Regressor>& regressors) {
  std::erase_if(regressors, [&](const Regressor& r) {
    return (signals & MaskOf(r.signal)) == 0;
  });
}

}  // namespace

TrainingRun WithSignals(TrainingRun run, SignalMask signals) {
  for (LabelledSample& labelled : run.samples) {
    labelled.sample.present &= signals;
  }
  return run;
}

TrainingRun SimulateHealthyRun(const ValveType& type, double duration_s) {
  TrainingRun run;
  run.id = type.name;
  run.flow_unit = type.parameters.instruments.flow_unit;
  for (Sample& sample : SimulateHealthy(type, duration_s, kSeed)) {
    run.samples.push_back({sample, FaultTruth{}});
  }
  return run;
}

TrainingOptions OnboardingPreset(SignalMask signals) {
  if ((signals & MaskOf(Signal::kCv)) == 0 || (signals & kRodSignals) == 0) {
    throw DataError("the valve has the signals " + SignalList(signals) +
                    ": CV, and X or F, are the least that faults show in");
  }
  TrainingOptions options = PresetOptions("extended");
  options.preset = "onboard";
  // The rules of a channel need what they are chosen by: F has no channel of
  // its own without X, only the one that predicts it from CV.
  std::erase_if(options.channels, [&](const ChannelPlan& plan) {
    return (signals & MaskOf(plan.output)) == 0 ||
           std::ranges::any_of(plan.antecedents, [&](const Regressor& r) {
             return (signals & MaskOf(r.signal)) == 0;
           });
  });
  using enum Signal;
  for (ChannelPlan& plan : options.channels) {
    if (plan.name == "X") {
      // Without the pressures, which are elsewhere on another day.
      plan.own_past = {{{kCv, 0}, {kCv, 1}, {kX, 1}, {kX, 2}},
                       {{kCv, 0}, {kCv, 1}, {kCv, 2}, {kX, 1}, {kX, 2}}};
    }
    if (plan.output == kF && (signals & MaskOf(kX)) == 0) {
      // A flow that hardly follows the command is all that there is: many rules
      // would learn its noise, and err where the command goes for once.
      plan.rule_counts.insert(plan.rule_counts.begin(), {1, 2});
    }
    for (std::vector<Regressor>& pool : plan.pools) {
      Restrict(signals, pool);
    }
  }
  return options;
}

namespace {

// Not filled in when a table was resampled.
bool IsMeasured(const Sample& sample, Signal signal) {
  return sample.quality[Index(signal)] == SignalQuality::kGood;
}

}  // namespace

std::vector<std::string> DropUnreadChannels(
    const std::vector<TrainingRun>& runs, std::vector<ChannelPlan>& channels) {
  constexpr std::ptrdiff_t kMinReadings = 100;
  std::vector<std::string> unread;
  std::erase_if(channels, [&](const ChannelPlan& plan) {
    if (plan.output == Signal::kX || plan.output == Signal::kF) {
      return false;
    }
    std::ptrdiff_t readings = 0;
    for (const TrainingRun& run : runs) {
      readings += std::ranges::count_if(run.samples, [&](const auto& labelled) {
        return IsMeasured(labelled.sample, plan.output);
      });
    }
    if (readings < kMinReadings) {
      unread.push_back(plan.name);
    }
    return readings < kMinReadings;
  });
  return unread;
}

std::vector<TrainingRun> WithoutStops(std::vector<TrainingRun> runs) {
  constexpr double kStop = 2.0;  // from an end of the travel [%]
  constexpr double kAfterS = 60.0;
  constexpr double kMaxStopShare = 0.05;
  const auto at_stop = [](const LabelledSample& labelled) {
    const Sample& sample = labelled.sample;
    const double x = sample[sample.Has(Signal::kX) ? Signal::kX : Signal::kCv];
    return x <= kStop || x >= 100.0 - kStop;
  };
  double stops = 0.0;
  double samples = 0.0;
  for (const TrainingRun& run : runs) {
    stops += static_cast<double>(std::ranges::count_if(run.samples, at_stop));
    samples += static_cast<double>(run.samples.size());
  }
  const auto is_empty = [](const auto& run) { return run.samples.empty(); };
  if (stops > kMaxStopShare * samples) {
    std::erase_if(runs, is_empty);
    return runs;
  }
  for (TrainingRun& run : runs) {
    // A run that does not begin at a stop keeps its first minute. The predicate
    // keeps this state outside of itself, because erase_if() copies it.
    double since_s = kAfterS;
    std::erase_if(run.samples, [&](const LabelledSample& labelled) {
      since_s = at_stop(labelled) ? 0.0 : since_s + run.period_s;
      return since_s < kAfterS;
    });
  }
  std::erase_if(runs, is_empty);
  return runs;
}

namespace {

// Shares of the work, for the progress bar.
constexpr double kFitShare = 0.2;
constexpr double kTrainShare = 0.7;

constexpr std::size_t kMinSamples = 600;
constexpr int kMinFitRows = 360;  // of slow data

Progress Part(const Progress& progress, double from, double share) {
  return [&progress, from, share](double done, std::string_view stage) {
    if (progress) {
      progress(from + share * done, stage);
    }
  };
}

Stretch LongestStretch(const std::vector<TrainingRun>& runs) {
  Stretch longest;
  for (const TrainingRun& run : runs) {
    for (Stretch& stretch : SplitAtGaps(run)) {
      if (stretch.samples.size() > longest.samples.size()) {
        longest = std::move(stretch);
      }
    }
  }
  return longest;
}

// 25 minutes, or more where kMinSamples take longer.
std::string LeastRecord(const std::vector<TrainingRun>& runs) {
  const double minutes = runs.front().period_s * kMinSamples / 60.0;
  return std::to_string(std::max(25, static_cast<int>(std::ceil(minutes)))) +
         " minutes";
}

// Names what cuts the record into pieces: missing readings, by signal, or gaps.
std::string Interruptions(const std::vector<TrainingRun>& runs) {
  std::array<std::size_t, kSignalCount> lacks{};
  std::size_t samples = 0;
  SignalMask some = 0;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      some = static_cast<SignalMask>(some | labelled.sample.present);
    }
  }
  for (const TrainingRun& run : runs) {
    samples += run.samples.size();
    for (const LabelledSample& labelled : run.samples) {
      for (std::size_t i = 0; i < kSignalCount; ++i) {
        const auto signal = static_cast<Signal>(i);
        lacks[i] += (some & kBasicSignals & MaskOf(signal)) != 0 &&
                            !labelled.sample.Has(signal)
                        ? 1U
                        : 0U;
      }
    }
  }
  const auto worst = std::ranges::max_element(lacks);
  if (*worst > 0) {
    const std::string name(
        SignalName(static_cast<Signal>(worst - lacks.begin())));
    return ". Likeliest: " + name + " is missing in " + std::to_string(*worst) +
           " of " + std::to_string(samples) +
           " samples (no reading, or bad quality), which cuts the record. Take "
           "a longer record, or a stretch without them with @from:to, or leave "
           "the signal out with --signals";
  }
  return samples < kMinSamples
             ? ". The whole record has " + std::to_string(samples) +
                   ": export at least " + LeastRecord(runs) +
                   " of normal operation"
             : ". Likeliest: gaps cut the record, or samples with other "
               "signals than the first. Export one stretch of at least " +
                   LeastRecord(runs) + ", or fill short gaps with --resample " +
                   std::to_string(
                       std::max(1L, std::lround(runs.front().period_s))) +
                   "s:linear";
}

void RequireHealthy(const std::vector<TrainingRun>& runs) {
  Require(!runs.empty(), "no run was given");
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      if (labelled.truth && labelled.truth->strength != 0.0) {
        throw DataError("run " + run.id +
                        " has samples with a fault: onboarding takes healthy "
                        "ones, select them with ID@from:to");
      }
    }
  }
  const std::size_t longest = LongestStretch(runs).samples.size();
  if (longest < kMinSamples) {
    throw DataError("the runs have at most " + std::to_string(longest) +
                    " samples in a row, onboarding takes at least " +
                    std::to_string(kMinSamples) + Interruptions(runs));
  }
}

// The type with a flow transmitter in `unit`: its range is converted by the
// density at the usual temperature.
ValveType InUnit(ValveType type, FlowUnit unit) {
  simulator::Instrumentation& instruments = type.parameters.instruments;
  if (instruments.flow_unit != unit) {
    const double density =
        simulator::MediumAt(type.parameters.medium, 1e3 * type.levels.p1_kpa,
                            1e3 * type.levels.p2_kpa, type.levels.t1_degc)
            .density_kg_m3;
    for (double* value : {&instruments.flow.low, &instruments.flow.high,
                          &instruments.flow.noise_sd}) {
      *value = simulator::FlowInUnit(
          unit, simulator::FlowFromUnit(instruments.flow_unit, *value, density),
          density);
    }
    instruments.flow_unit = unit;
  }
  return type;
}

// Stretches without a gap as records of the simulator.
std::vector<simulator::HealthyRecord> Records(
    const std::vector<TrainingRun>& runs, const InputRow& levels) {
  std::vector<simulator::HealthyRecord> records;
  for (const TrainingRun& run : runs) {
    for (const Stretch& stretch : SplitAtGaps(run)) {
      records.emplace_back();
      for (const Sample& sample : stretch.samples) {
        const bool has_x = sample.Has(Signal::kX);
        records.back().rows.push_back(
            {InputsOf(sample, levels), sample[has_x ? Signal::kX : Signal::kCv],
             sample[Signal::kF], has_x && IsMeasured(sample, Signal::kX),
             IsMeasured(sample, Signal::kF)});
      }
    }
  }
  return records;
}

simulator::ValveFit FitType(const std::vector<TrainingRun>& runs,
                            const OnboardingOptions& options) {
  simulator::ValveFitOptions fit;
  fit.has_flow = runs.front().samples.front().sample.Has(Signal::kF);
  fit.period_s = runs.front().period_s;
  // Rows beyond what a valve settles in cost as much each, and tell no more.
  fit.max_rows =
      std::max(kMinFitRows,
               static_cast<int>(
                   fit.max_rows /
                   std::max(1.0, simulator::SimulatedPeriod(
                                     fit.period_s, options.type.parameters))));
  fit.threads =
      options.threads > 0
          ? options.threads
          : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return simulator::FitValve(Records(runs, options.type.levels),
                             options.type.parameters, fit);
}

std::vector<double> SortedReadings(const std::vector<TrainingRun>& runs,
                                   Signal signal) {
  std::vector<double> readings;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      if (labelled.sample.Has(signal)) {
        readings.push_back(labelled.sample[signal]);
      }
    }
  }
  std::ranges::sort(readings);
  return readings;
}

// Lowest and highest reading but for one in a thousand, which may be broken; 0
// and 0 without any.
std::pair<double, double> RangeOf(const std::vector<TrainingRun>& runs,
                                  Signal signal) {
  constexpr double kBroken = 1e-3;
  const std::vector<double> readings = SortedReadings(runs, signal);
  if (readings.empty()) {
    return {0.0, 0.0};
  }
  return {SortedQuantile(readings, kBroken),
          SortedQuantile(readings, 1.0 - kBroken)};
}

constexpr double kUse = 0.8;  // Share of the range of a transmitter.

// Readings beyond the range of the type's transmitter would be held to it.
void WidenRanges(const std::vector<TrainingRun>& runs,
                 simulator::Instrumentation& instruments) {
  const auto widen = [&](Signal signal, simulator::Transmitter& transmitter) {
    const auto [lowest, highest] = RangeOf(runs, signal);
    if (highest > transmitter.high) {
      transmitter.high = highest / kUse;
    }
    if (lowest < transmitter.low) {
      transmitter.low = std::min(lowest, lowest / kUse);
    }
  };
  widen(Signal::kP1, instruments.pressure);
  widen(Signal::kP2, instruments.pressure);
  widen(Signal::kT1, instruments.temperature);
}

// Where the type does not state the pressures of this valve: a transmitter for
// ten times its pressure would take a change of a tenth of it for nothing.
void NarrowPressures(const std::vector<TrainingRun>& runs,
                     simulator::Instrumentation& instruments) {
  constexpr double kLeastUse = 0.2;
  simulator::Transmitter& pressure = instruments.pressure;
  const double highest = std::max(RangeOf(runs, Signal::kP1).second,
                                  RangeOf(runs, Signal::kP2).second);
  if (highest > 0.0 && highest < kLeastUse * pressure.high) {
    pressure.noise_sd *= highest / kUse / pressure.high;
    pressure.high = highest / kUse;
  }
}

// Substitutes for P1, P2 and T1 where they are not measured, beside those that
// are: one pressure has the ratio of the type to the other, and a liquid does
// not boil at it.
InputRow LevelsOf(const std::vector<TrainingRun>& runs, const ValveType& type) {
  constexpr double kColdC = 43.0;
  InputRow levels = type.levels;
  const std::vector<double> p1 = SortedReadings(runs, Signal::kP1);
  const std::vector<double> p2 = SortedReadings(runs, Signal::kP2);
  const double ratio = levels.p2_kpa / levels.p1_kpa;
  if (p2.empty() && !p1.empty()) {
    levels.p2_kpa = ratio * SortedQuantile(p1, 0.5);
  } else if (p1.empty() && !p2.empty() && SortedQuantile(p2, 0.5) > 0.0) {
    levels.p1_kpa = SortedQuantile(p2, 0.5) / ratio;
  }
  const double inlet_kpa = p1.empty() ? levels.p1_kpa : SortedQuantile(p1, 0.5);
  if (1e-3 * simulator::VapourPressure(type.parameters.medium, levels.t1_degc) >
      inlet_kpa) {
    levels.t1_degc = std::min(levels.t1_degc, kColdC);
  }
  return levels;
}

// The type in the size of the valve. Where the flow is that of the type within
// a factor of 2 and its transmitter reaches as far as the record, the type
// stays as it is.
void Resize(const std::vector<TrainingRun>& runs, Onboarding& onboarding) {
  constexpr double kAlike = 2.0;
  ValveType& type = onboarding.type;
  const double size =
      simulator::SizeOf(Records(runs, type.levels), type.parameters);
  const double largest = RangeOf(runs, Signal::kF).second;
  const bool alike = size < kAlike && size > 1.0 / kAlike &&
                     largest <= type.parameters.instruments.flow.high;
  if (!alike) {
    onboarding.size = size;
    type.parameters = simulator::Resized(type.parameters, size, largest);
  }
}

// f of the trim for the floor, which fits an exponential one by itself.
std::vector<double> FlowShape(const simulator::Trim& trim) {
  std::vector<double> shape;
  if (trim.characteristic != simulator::FlowCharacteristic::kExponential) {
    constexpr int kLast = FloorLimits::kShapePoints - 1;
    for (int i = 0; i <= kLast; ++i) {
      shape.push_back(simulator::Opening(trim, static_cast<double>(i) / kLast));
    }
  }
  return shape;
}

// Parameters by which the second look simulates the healthy valve.
std::vector<PhysicalValue> Physics(const ValveType& type,
                                   const std::vector<TrainingRun>& runs) {
  std::vector<std::vector<RecordRow>> records;
  for (simulator::HealthyRecord& record : Records(runs, type.levels)) {
    records.push_back(std::move(record.rows));
  }
  return simulator::ToValues(simulator::DescribeValve(
      type.parameters,
      {runs.front().period_s, type.interpolated_command, type.command_delay},
      records));
}

// For the readings of `output`, or for X − CV if that is compared.
struct Moments {
  double mean{0.0};
  double square{0.0};
};

Moments MomentsOf(const std::vector<TrainingRun>& runs, Signal output,
                  bool less_command) {
  double sum = 0.0;
  double squares = 0.0;
  double count = 0.0;
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      const Sample& sample = labelled.sample;
      if (!IsMeasured(sample, output)) {
        continue;
      }
      const double y =
          sample[output] - (less_command ? sample[Signal::kCv] : 0.0);
      sum += y;
      squares += y * y;
      count += 1.0;
    }
  }
  return {sum / count, squares / count};
}

// sqrt(E[y²] − E[y]²), the error of the mean as a model; for X, y is X − CV and
// its mean counts as an error, because the model is X = CV. Rounding may take
// the difference of a nearly constant reading below 0.
double NaiveError(const std::vector<TrainingRun>& runs, Signal output) {
  const bool is_x = output == Signal::kX;
  const Moments y = MomentsOf(runs, output, is_x);
  const double mean = is_x ? 0.0 : y.mean;
  return std::sqrt(std::max(0.0, y.square - mean * mean));
}

// A change that lasts moves single residuals and their means alike.
double SeenFrom(const ChannelSpec& channel) {
  double up = channel.upper_threshold;
  double down = -channel.lower_threshold;
  for (const WindowLimits& window : channel.windows) {
    up = std::min(up, window.upper_mean);
    down = std::min(down, -window.lower_mean);
  }
  return std::max(up, down);
}

std::vector<ChannelFit> FitsOf(const ModelSet& models,
                               const std::vector<TrainingRun>& runs) {
  std::vector<ChannelFit> fits;
  const Observer& normal = models.observers.front();
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const ChannelObserver& channel = normal.channels[c];
    fits.push_back({models.channels[c].name, models.channels[c].output,
                    channel.residual_sd, channel.validation.bias,
                    channel.validation.vaf,
                    NaiveError(runs, models.channels[c].output),
                    SeenFrom(models.channels[c]),
                    MomentsOf(runs, models.channels[c].output, false).mean});
  }
  return fits;
}

TrainingOptions TrainingOf(const OnboardingOptions& options,
                           SignalMask signals) {
  TrainingOptions training = OnboardingPreset(signals);
  training.name = options.name;
  training.threads = options.threads;
  training.false_alarms_per_hour = options.false_alarms_per_hour;
  training.software = options.software;
  training.created_ns = options.created_ns;
  // Records of a plant have no truth. Those whose truth has a fault were
  // refused by RequireHealthy().
  training.dataset.assume_normal = true;
  return training;
}

// Lengths of the simulated record of a type: for the models, and to score them.
constexpr std::size_t kTypeSamples = 1800;
constexpr std::size_t kTypeUnseen = 1020;

// The type as it is against the longest stretch.
simulator::RecordFit Compare(const std::vector<TrainingRun>& runs,
                             const ValveType& type) {
  constexpr std::size_t kSettling = 60;
  const std::vector<simulator::HealthyRecord> records =
      Records(runs, type.levels);
  const simulator::HealthyRecord& longest = *std::ranges::max_element(
      records, {}, [](const auto& record) { return record.rows.size(); });
  return simulator::FitToRecord(
      type.parameters, longest.rows, kSettling, longest.rows.size(),
      {runs.front().period_s, type.interpolated_command, type.command_delay});
}

// The physics stay as they were where hours that a person vouches for do not
// suit any: they count for what the observers see.
void FitPhysics(const std::vector<TrainingRun>& runs,
                const OnboardingOptions& options, double meter_end,
                Onboarding& onboarding) {
  OnboardingOptions from = options;
  from.type = onboarding.type;
  const simulator::ValveFit fit = FitType(runs, from);
  try {
    CheckFit(runs, fit.fitted, fit.values, meter_end);
  } catch (const DataError&) {
    if (options.extends) {
      return;
    }
    throw;
  }
  onboarding.type.parameters = fit.parameters;
  onboarding.type.interpolated_command = fit.interpolated_command;
  onboarding.type.command_delay = fit.command_delay;
  onboarding.fit = fit;
}

std::vector<TrainingRun> FormerRuns(const std::vector<TrainingRun>& all,
                                    std::size_t count) {
  return WithoutStops(
      {all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count)});
}

double Hours(const std::vector<TrainingRun>& runs) {
  double hours = 0.0;
  for (const TrainingRun& run : runs) {
    hours += run.period_s * static_cast<double>(run.samples.size()) / 3600.0;
  }
  return hours;
}

SignalMask SignalsOf(const std::vector<TrainingRun>& runs) {
  return runs.front().samples.front().sample.present & kBasicSignals;
}

std::vector<FaultCondition> FaultsOf(SignalMask signals,
                                     const simulator::ValveParameters& valve,
                                     bool at_position) {
  std::vector<FaultCondition> faults = OnboardingFaults(signals, valve);
  if (at_position) {
    std::erase_if(faults, [](const FaultCondition& fault) {
      return simulator::ShowsInRodAlone(fault.fault);
    });
  }
  return faults;
}

// The parts of an onboarding that coverage needs.
struct Scoring {
  const std::vector<TrainingRun>& runs;
  const std::vector<FaultCondition>& faults;
  const FaultSynthesizer& synthesize;
  const FaultyStretches& simulated;  // Empty where the type's set serves.
  const TrainingOptions& training;
  const OnboardingOptions& options;
};

// A part of the record, with a set made as `models` was, from all but it.
ScoredPart LeaveOut(const Scoring& scoring, const ModelSet& models,
                    const std::vector<Stretch>& stretches,
                    const RecordPart& part, bool transferred) {
  ScoredPart scored;
  scored.healthy = CutOut(stretches[part.stretch], part);
  scored.faulty.resize(scoring.faults.size());
  const std::vector<TrainingRun> rest =
      RunsWithout(scoring.runs, scored.healthy);
  if (!transferred) {
    for (std::size_t f = 0; f < scored.faulty.size(); ++f) {
      scored.faulty[f] =
          CutOut(scoring.simulated.faulty[f][part.stretch], part).samples;
    }
    scored.models = std::make_shared<const ModelSet>(RetrainDifferenceSet(
        models, rest, scoring.faults, Without(scoring.simulated, part),
        scoring.training));
    return scored;
  }
  ParallelFor(static_cast<int>(scored.faulty.size()), scoring.options.threads,
              [&](int i) {
                const auto f = static_cast<std::size_t>(i);
                scored.faulty[f] =
                    scoring.synthesize(scoring.faults[f], scored.healthy);
              });
  scored.models = std::make_shared<const ModelSet>(
      TransferDifferenceSet(*scoring.options.of_type, rest, scoring.training));
  return scored;
}

// Every part of the record is judged by models that did not see it.
void ScoreUnseen(const Scoring& scoring, Onboarding& onboarding) {
  std::vector<Stretch> stretches = scoring.simulated.healthy;
  if (onboarding.transferred) {
    for (const TrainingRun& run : scoring.runs) {
      std::ranges::move(SplitAtGaps(run), std::back_inserter(stretches));
    }
  }
  try {
    std::vector<ScoredPart> parts;
    for (const RecordPart& part : PartsOf(stretches)) {
      parts.push_back(LeaveOut(scoring, onboarding.models, stretches, part,
                               onboarding.transferred));
    }
    onboarding.coverage =
        ScoreCoverage(scoring.faults, parts, scoring.options.threads);
  } catch (const DataError& error) {
    onboarding.unscored = error.what();
  }
}

// Both sets are asked for what both have seen, so that they are comparable.
std::vector<CoverageChange> CompareWithFormer(
    const std::vector<TrainingRun>& all, const Scoring& scoring,
    const ModelSet& models) {
  Stretch stretch =
      LongestStretch(FormerRuns(all, scoring.options.former_runs));
  // The engine reads the position as the command, the synthesizer the command.
  for (Sample& sample : stretch.samples) {
    if (models.position_as_command && sample.Has(Signal::kX)) {
      sample.Set(Signal::kCv, sample[Signal::kX]);
    }
  }
  const auto assess = [&](std::shared_ptr<const ModelSet> set) {
    return AssessCoverage(std::move(set), scoring.faults,
                          std::ref(scoring.synthesize), stretch,
                          scoring.options.threads);
  };
  return ChangesOf(assess(scoring.options.extends),
                   assess(std::make_shared<const ModelSet>(models)));
}

// Faults act in proportion to the size of a valve, so that a set serves valves
// of its own size only.
bool HasSizeOfType(const std::vector<TrainingRun>& runs,
                   const Onboarding& onboarding) {
  constexpr double kAlike = 1.25;
  if ((onboarding.signals & MaskOf(Signal::kF)) == 0) {
    return true;
  }
  const double size = simulator::SizeOf(Records(runs, onboarding.type.levels),
                                        onboarding.type.parameters);
  return size <= kAlike && size >= 1.0 / kAlike;
}

// The ranges of the type become those of the record.
void TakeRangesOf(const std::vector<TrainingRun>& runs, bool resize,
                  Onboarding& result) {
  WidenRanges(runs, result.type.parameters.instruments);
  if (result.type.of_any_size) {
    NarrowPressures(runs, result.type.parameters.instruments);
    if (resize) {
      Resize(runs, result);
    }
  }
}

}  // namespace

// Each check refuses the record before the work that it would spoil:
//
//   RequireHealthy   the record as given, and once more without its stops,
//                    which may have cut its longest stretch short
//   RequireAlike     runs that differ in period, flow unit or signals
//   CheckRecords     units and sense, before anything is fitted to them
//   CommandIsLost    not refused: from there on the position is the command
//   InUnit, LevelsOf, TakeRangesOf
//                    the ranges of the type in the unit and of the size of the
//                    record, before simulated and measured readings are
//                    compared
//   CheckFit         the physics, before faults are simulated by it
//
// The hours reported are those of the record as given.
Onboarding Onboard(const std::vector<TrainingRun>& all,
                   const OnboardingOptions& options, const Progress& progress) {
  RequireHealthy(all);
  std::vector<TrainingRun> runs = WithoutStops(all);
  RequireHealthy(runs);
  RequireAlike(runs);
  Onboarding result;
  SignalMask signals = result.signals = SignalsOf(runs);
  TrainingOptions training = TrainingOf(options, signals);
  CheckRecords(runs, options.type.parameters.medium);
  const bool at_position = options.extends
                               ? options.extends->position_as_command
                               : CommandIsLost(runs);
  if (at_position) {
    std::ranges::transform(runs, runs.begin(), AtPosition);
    signals = SignalsOf(runs);
    training = TrainingOf(options, signals);
  }
  result.unread = DropUnreadChannels(runs, training.channels);
  result.type = (signals & MaskOf(Signal::kF)) != 0
                    ? InUnit(options.type, runs.front().flow_unit)
                    : options.type;
  result.type.levels = LevelsOf(runs, result.type);
  TakeRangesOf(runs, options.fit && (signals & MaskOf(Signal::kF)) != 0,
               result);
  const double meter_end = result.type.parameters.instruments.flow.high;
  if (options.fit) {
    Part(progress, 0.0, kFitShare)(0.0, "fitting the physical parameters");
    FitPhysics(runs, options, meter_end, result);
  } else {
    CheckFit(runs, Compare(runs, result.type), {}, meter_end);
  }
  training.flow_shape = FlowShape(result.type.parameters.trim);
  const FaultSynthesizer synthesize(result.type, at_position);
  const std::vector<FaultCondition> faults =
      FaultsOf(signals, result.type.parameters, at_position);
  const Progress part = Part(progress, kFitShare, kTrainShare);
  result.transferred = options.of_type &&
                       options.of_type->position_as_command == at_position &&
                       IsTransferable(*options.of_type, runs, training) &&
                       HasSizeOfType(runs, result);
  FaultyStretches simulated;
  result.models =
      result.transferred
          ? TransferDifferenceSet(*options.of_type, runs, training, part)
          : TrainDifferenceSet(runs, faults, std::ref(synthesize), meter_end,
                               training, part,
                               options.assess ? &simulated : nullptr);
  result.models.physics = Physics(result.type, runs);
  result.models.position_as_command = at_position;
  result.channels = FitsOf(result.models, runs);
  result.hours = Hours(all);
  result.left_out_s = 3600.0 * (result.hours - Hours(runs));
  if (options.assess) {
    Part(progress, kFitShare + kTrainShare, 0.0)(0.0, "scoring every fault");
    const Scoring scoring{runs,      faults,   synthesize,
                          simulated, training, options};
    ScoreUnseen(scoring, result);
    if (options.extends) {
      result.changes = CompareWithFormer(all, scoring, result.models);
    }
  }
  Part(progress, 1.0, 0.0)(0.0, "done");
  return result;
}

// std::function copies what it is given, and the synthesizer has a mutex: hence
// std::ref().
CoverageTable AssessType(const ValveType& type, SignalMask signals,
                         const OnboardingOptions& options,
                         const Progress& progress) {
  TrainingRun run = WithSignals(
      SimulateHealthyRun(type, static_cast<double>(kTypeSamples + kTypeUnseen)),
      signals);
  Stretch unseen{run.id, {}};
  for (std::size_t k = kTypeSamples; k < run.samples.size(); ++k) {
    unseen.samples.push_back(run.samples[k].sample);
  }
  run.samples.resize(kTypeSamples);
  const FaultSynthesizer synthesize(type);
  const std::vector<FaultCondition> faults =
      OnboardingFaults(signals, type.parameters);
  const auto models = std::make_shared<const ModelSet>(
      TrainDifferenceSet({run}, faults, std::ref(synthesize),
                         type.parameters.instruments.flow.high,
                         TrainingOf(options, signals), progress));
  return AssessCoverage(models, faults, std::ref(synthesize), unseen,
                        options.threads);
}

}  // namespace fdi::trainer
