#include "trainer/difference_observers.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/parallel_for.h"
#include "diagnosis/model/fault_catalogue.h"
#include "trainer/calibration.h"
#include "trainer/channel_training.h"
#include "trainer/dead_bands.h"
#include "trainer/model_set_description.h"
#include "trainer/observer_calibration.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

constexpr double kMaxOwnPastErrorRatio = 0.98;  // of the error without
constexpr double kMinPosition = 0.0;  // ends of the position transmitter [%]
constexpr double kMaxPosition = 100.0;

// The plan of a normal model that runs on its own past.
// The only pool holds just the antecedents, so that ChooseRegressors() has
// nothing to search.
ChannelPlan OwnPastPlan(const ChannelPlan& plan,
                        const std::vector<Regressor>& regressors) {
  ChannelPlan own = plan;
  own.pools = {regressors};
  own.antecedents = regressors;
  own.rule_counts = {4, 8, 16, 24};
  own.from_any_past = true;
  own.parallel = true;
  return own;
}

TsModel FitPlan(const ChannelPlan& plan, const Condition& normal,
                const TrainingOptions& options, double saturation) {
  return FitChannel(plan,
                    ChooseRegressors(plan, normal, options.fit, saturation),
                    normal, FitOptionsOf(plan, options.fit), saturation);
}

// A reading at an end of its transmitter says only that the true value is there
// or beyond.
bool AtLimit(const TsModel& normal, double reading) {
  return reading >= normal.saturation ||
         (normal.output == Signal::kX &&
          (reading <= kMinPosition || reading >= kMaxPosition));
}

std::vector<std::vector<double>> PredictAll(
    const TsModel& model, const std::vector<Stretch>& stretches) {
  std::vector<std::vector<double>> predictions;
  for (const Stretch& stretch : stretches) {
    predictions.push_back(RunPredictions(model, stretch));
  }
  return predictions;
}

// A reading with the fault, cleared of the background of the valve; readings at
// a limit stay.
//
//     F_i ŷ_0/F,   X_i − (X − ŷ_0),
//
// F and X the healthy readings, F_i and X_i those with the fault. A healthy
// flow of 0 has no ratio, and the difference is taken. Without the background,
// a reading at a limit would become an ordinary one, and the fit would no
// longer know that the limit hides the value.
double CleanReading(const TsModel& normal, double healthy, double predicted,
                    double faulty) {
  if (AtLimit(normal, faulty)) {
    return faulty;
  }
  const bool proportional = normal.output == Signal::kF && healthy > 0.0;
  return proportional ? faulty * predicted / healthy
                      : faulty + predicted - healthy;
}

// ŷ_0 over the readings with the fault in force, which δ_i adds to; empty where
// the observer stands for itself.
using Predictions = std::vector<std::vector<double>>;  // by stretch

Predictions BaseOf(const NormalChannel& channel,
                   const std::vector<Stretch>& faulty) {
  return channel.difference ? PredictAll(channel.normal, faulty)
                            : Predictions{};
}

// The targets of δ_i, or of ŷ_i where it is not a difference, in place of the
// readings.
Condition Targets(const NormalChannel& channel,
                  const std::vector<Stretch>& healthy,
                  const std::vector<Stretch>& faulty, const Predictions& base,
                  const FaultCondition& fault) {
  const Signal output = channel.normal.output;
  Condition targets{fault.fault, fault.strength, {}, {}};
  for (std::size_t i = 0; i < faulty.size(); ++i) {
    Stretch stretch = faulty[i];
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      stretch.samples[k].Set(
          output,
          CleanReading(channel.normal, healthy[i].samples[k][output],
                       channel.expected[i][k], faulty[i].samples[k][output]) -
              (base.empty() ? 0.0 : base[i][k]));
    }
    targets.training.push_back(std::move(stretch));
    // WholeStretch() pairs training and validation parts by index.
    targets.validation.push_back({faulty[i].run_id, {}});
  }
  return targets;
}

// The rules of `inputs` without anything to say.
// A difference is not a reading, so no limit of a transmitter applies to it.
// Its output range is [0, 0]; AdaptModel() widens it as the targets require.
TsModel ZeroEffect(TsModel inputs) {
  for (TsRule& rule : inputs.rules) {
    rule.intercept = 0.0;
    std::fill(rule.slopes.begin(), rule.slopes.end(), 0.0);
  }
  inputs.output_min = 0.0;
  inputs.output_max = 0.0;
  inputs.saturation = std::numeric_limits<double>::infinity();
  return inputs;
}

struct Readings {
  std::vector<double> residuals;
  std::vector<double> outputs;
};

// Runs ŷ_i over the faulty readings, as the engine does.
Readings RunObserver(const NormalChannel& channel, const TsModel& model,
                     const std::vector<Stretch>& faulty,
                     const Predictions& base, int settling) {
  Readings readings;
  for (std::size_t i = 0; i < faulty.size(); ++i) {
    const Stretch& stretch = faulty[i];
    std::vector<double> predictions = RunPredictions(model, stretch);
    for (std::size_t k = 0; !base.empty() && k < predictions.size(); ++k) {
      predictions[k] += base[i][k];
    }
    for (auto k = static_cast<std::size_t>(settling);
         k < stretch.samples.size(); ++k) {
      const double reading = stretch.samples[k][channel.normal.output];
      // The limit is that of ŷ_0: a difference has none of its own.
      const double r = Residual(channel.normal, reading, predictions[k]);
      if (!std::isnan(r)) {
        readings.residuals.push_back(r);
        readings.outputs.push_back(reading);
      }
    }
  }
  return readings;
}

// The model from which δ_i or ŷ_i is adapted.
TsModel Base(const NormalChannel& channel) {
  return channel.difference ? ZeroEffect(channel.inputs) : channel.inputs;
}

Condition Whole(std::vector<Stretch> stretches) {
  Condition condition;
  for (Stretch& stretch : stretches) {
    condition.validation.push_back({stretch.run_id, {}});
    condition.training.push_back(std::move(stretch));
  }
  return condition;
}

NormalChannel ChooseNormal(const ChannelPlan& plan, const Condition& normal,
                           const TrainingOptions& options, double saturation) {
  const auto error = [&](const TsModel& model) {
    return MeanSquare(
        RunResiduals(model, normal.validation, options.fit.settling));
  };
  NormalChannel channel{
      plan, FitPlan(plan, normal, options, saturation), {}, false, {}};
  channel.inputs = channel.normal;
  // A candidate has to beat the model of the inputs on plain validation error.
  // Among those that do, the one that forgets its past best is taken: a model
  // fitted one step ahead can rest for half a minute where no valve would, and
  // its plain error over some hours does not show that
  // (docs/design/onboarding.md, 2). One that may stay at a limit of its
  // predictions is none. An error of NaN compares false and never wins.
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<Regressor>& regressors : plan.own_past) {
    const ChannelPlan own_plan = OwnPastPlan(plan, regressors);
    TsModel own = FitPlan(own_plan, normal, options, saturation);
    const double from_any_past = FreeRunError(own, normal.validation);
    if (IsFreeRunning(own) && ForgetsItsPast(own, normal.training) &&
        from_any_past < least &&
        error(own) < kMaxOwnPastErrorRatio * error(channel.inputs)) {
      least = from_any_past;
      channel.plan = own_plan;
      channel.normal = std::move(own);
      channel.difference = true;
    }
  }
  return channel;
}

void PrepareFaults(const std::vector<Stretch>& healthy,
                   NormalChannel& channel) {
  channel.expected = PredictAll(channel.normal, healthy);
  channel.adaptation.emplace(Base(channel), Whole(healthy));
}

}  // namespace

NormalChannel FitNormalChannel(const ChannelPlan& plan, const Condition& normal,
                               const std::vector<Stretch>& healthy,
                               const TrainingOptions& options,
                               double saturation) {
  NormalChannel channel = ChooseNormal(plan, normal, options, saturation);
  PrepareFaults(healthy, channel);
  return channel;
}

ChannelObserver FitDifference(const NormalChannel& channel,
                              const ChannelObserver& normal_observer,
                              const std::vector<Stretch>& healthy,
                              const std::vector<Stretch>& faulty,
                              const FaultCondition& fault, int settling) {
  const Predictions base = BaseOf(channel, faulty);
  const Condition targets = Targets(channel, healthy, faulty, base, fault);
  // A fault that moves a regressor (t1 moves T1, f1 the measured X of a flow
  // model) has rows of its own; all others share one factorization.
  const AdaptedModel adapted = channel.adaptation->Serves(targets)
                                   ? channel.adaptation->Fit(targets)
                                   : AdaptModel(Base(channel), targets);
  Readings readings =
      RunObserver(channel, adapted.model, faulty, base, settling);
  const double sd = normal_observer.residual_sd;
  // These residuals are too small, because ŷ_0 was fitted to the background
  // that the readings carry, and δ_i to the readings. Background and error of
  // δ_i are taken as independent, so that on new data
  //
  //     E[r²] = s_0² + E[ε²],
  //
  // s_0 the held-out deviation of ŷ_0, ε the error of δ_i on the folds left
  // out. One factor brings the residuals there and keeps the shape of their
  // distribution, which sets the corners of the membership.
  const double held_out = sd * sd + MeanSquare(adapted.residuals);
  const double widening = std::max(
      1.0,
      std::sqrt(held_out / std::max(MeanSquare(readings.residuals), 1e-12)));
  for (double& residual : readings.residuals) {
    residual *= widening;
  }
  ChannelObserver observer = CalibrateChannel(
      adapted.model, readings.residuals, readings.outputs, kMinDeviation * sd);
  observer.difference = channel.difference;
  return observer;
}

namespace {

// Shares of the work, for the progress bar.
constexpr double kNormalShare = 0.1;
constexpr double kObserverShare = 0.75;

// Stretches of about `most` samples in all, evenly spread.
std::vector<Stretch> EvenShare(const std::vector<Stretch>& stretches,
                               std::size_t most) {
  const auto all = static_cast<std::size_t>(CountSamples(stretches));
  std::vector<Stretch> chosen;
  std::size_t passed = 0;
  std::size_t taken = 0;
  for (const Stretch& stretch : stretches) {
    passed += stretch.samples.size();
    if (taken * all < passed * most) {
      chosen.push_back(stretch);
      taken += stretch.samples.size();
    }
  }
  return chosen;
}

// Blocks of 600 samples, evenly spread, where there are more than 3600 in all:
// faults are exact, and more of the same tells nothing about them.
// Faults are simulated over all of them, each at several strengths, so that
// their length sets the cost. Blocks are contiguous, because lags and the
// simulation need the course in time. Where gaps leave too few blocks, whole
// stretches take their place.
std::vector<Stretch> Excerpt(const std::vector<Stretch>& stretches) {
  constexpr std::size_t kBlock = 600;
  constexpr std::size_t kMaxSamples = 3600;
  if (CountSamples(stretches) <= static_cast<std::int64_t>(kMaxSamples)) {
    return stretches;
  }
  std::vector<Stretch> blocks;
  for (const Stretch& stretch : stretches) {
    for (std::size_t k = 0; k + kBlock <= stretch.samples.size(); k += kBlock) {
      const auto begin =
          stretch.samples.begin() + static_cast<std::ptrdiff_t>(k);
      blocks.push_back({stretch.run_id,
                        {begin, begin + static_cast<std::ptrdiff_t>(kBlock)}});
    }
  }
  return EvenShare(blocks.size() * kBlock >= kMaxSamples ? blocks : stretches,
                   kMaxSamples);
}

std::vector<Stretch> Synthesize(const FaultCondition& fault,
                                const std::vector<Stretch>& healthy,
                                const FaultSynthesis& synthesize) {
  std::vector<Stretch> faulty;
  for (const Stretch& stretch : healthy) {
    faulty.push_back({stretch.run_id, synthesize(fault, stretch)});
    Require(faulty.back().samples.size() == stretch.samples.size(),
            "a synthesis must keep the number of samples");
  }
  return faulty;
}

// The last share of every stretch, where faults are compared.
Condition ValidationPart(const FaultCondition& fault,
                         const std::vector<Stretch>& faulty, double share) {
  Condition condition{fault.fault, fault.strength, {}, {}};
  for (const Stretch& stretch : faulty) {
    const auto count = static_cast<std::ptrdiff_t>(
        share * static_cast<double>(stretch.samples.size()));
    condition.validation.push_back(
        {stretch.run_id,
         {stretch.samples.end() - count, stretch.samples.end()}});
  }
  return condition;
}

// A set of faults also knows those that simulation alone names.
void AddSimulated(ModelSet& models) {
  SignalMask predicted = 0;
  for (const ChannelSpec& channel : models.channels) {
    predicted = static_cast<SignalMask>(predicted | MaskOf(channel.output));
  }
  for (int fault = 1; fault <= kLastFault && !models.faults.empty(); ++fault) {
    if (FaultFactsOf(fault).simulation_only && IsVisibleIn(fault, predicted) &&
        !Contains(models.faults, fault)) {
      models.faults.push_back(fault);
    }
  }
}

ModelSet Describe(const std::vector<TrainingRun>& healthy,
                  const Condition& normal,
                  const std::vector<FaultCondition>& faults,
                  const TrainingOptions& options) {
  ModelSet models = DescribeModelSet(healthy, {normal}, options);
  AddObserver(0, 0.0, models);
  for (const FaultCondition& fault : faults) {
    AddObserver(fault.fault, fault.strength, models);
  }
  AddSimulated(models);
  AddFindings(models);
  return models;
}

// Results of the healthy runs: the stretches that faults are put onto, and the
// models of every channel.
struct Healthy {
  Condition normal;
  std::vector<Stretch> stretches;
  std::vector<NormalChannel> channels;
};

Healthy FitHealthy(const std::vector<TrainingRun>& runs, double flow_limit,
                   const TrainingOptions& options) {
  Healthy healthy;
  healthy.normal = BuildConditions(runs, options.dataset).front();
  healthy.stretches = Excerpt(WholeStretches(healthy.normal));
  healthy.channels.resize(options.channels.size());
  ParallelFor(
      static_cast<int>(options.channels.size()), options.threads, [&](int c) {
        const auto i = static_cast<std::size_t>(c);
        const ChannelPlan& plan = options.channels[i];
        // The limit comes from the range of the transmitter, not from readings
        // as in FindSaturation(): a healthy flow may never reach the limit that
        // a fault drives it to.
        healthy.channels[i] = FitNormalChannel(
            plan, healthy.normal, healthy.stretches, options,
            plan.saturates ? (1.0 - kLimitShare) * flow_limit : kNoSaturation);
      });
  return healthy;
}

// Calibrates the normal observer on residuals held out; returns them.
NormalResiduals CalibrateHealthy(const Healthy& healthy,
                                 const TrainingOptions& options,
                                 Observer& observer) {
  // CrossValidate() takes regressors and numbers of rules from the observer, so
  // that CalibrateOn() comes first. CalibrateNormal() then replaces
  // memberships, deviations and correlation times by held-out ones; the figures
  // (MSE, VAF) remain those of the validation stretches.
  std::vector<ChannelPlan> plans;
  for (std::size_t c = 0; c < healthy.channels.size(); ++c) {
    plans.push_back(healthy.channels[c].plan);
    observer.channels[c] =
        CalibrateOn(healthy.channels[c].normal, healthy.normal,
                    options.fit.settling, kMinSd);
  }
  NormalResiduals held_out = CrossValidate(healthy.normal, observer, plans,
                                           options.fit, options.threads);
  CalibrateNormal(held_out.residuals, observer);
  return held_out;
}

void FitLimits(const Healthy& healthy, const NormalResiduals& held_out,
               const TrainingOptions& options, ModelSet& models) {
  std::vector<std::vector<int>> windows;
  for (const NormalChannel& channel : healthy.channels) {
    windows.push_back(channel.plan.windows);
  }
  FitThresholds(held_out.residuals, windows, options.false_alarms_per_hour,
                models, held_out.commands);
  CoverDeadBands(healthy.normal, models);
  BalanceThresholds(held_out.residuals, models);
}

// Healthy::stretches with a fault in force, given by its index.
using FaultySource = std::function<std::vector<Stretch>(std::size_t)>;

// Fits the observer of every fault. Returns the data on which faults are
// compared, parallel to the observers.
std::vector<Condition> FitFaults(const Healthy& healthy,
                                 const std::vector<FaultCondition>& faults,
                                 const FaultySource& faulty_by,
                                 const TrainingOptions& options,
                                 Reporter& reporter, ModelSet& models) {
  // A task writes only the observer and the entry of `compared` of its own
  // fault. All tasks read the normal observer, which is complete by now.
  std::vector<Condition> compared(faults.size() + 1);
  compared.front() = healthy.normal;
  std::atomic<int> done{0};
  ParallelFor(static_cast<int>(faults.size()), options.threads, [&](int i) {
    const FaultCondition& fault = faults[static_cast<std::size_t>(i)];
    Observer& observer = models.observers[static_cast<std::size_t>(i) + 1];
    const std::vector<Stretch> faulty = faulty_by(static_cast<std::size_t>(i));
    for (std::size_t c = 0; c < healthy.channels.size(); ++c) {
      observer.channels[c] = FitDifference(
          healthy.channels[c], models.observers.front().channels[c],
          healthy.stretches, faulty, fault, options.fit.settling);
    }
    compared[static_cast<std::size_t>(i) + 1] =
        ValidationPart(fault, faulty, options.dataset.validation_share);
    reporter.Report(kNormalShare + kObserverShare * ++done /
                                       static_cast<double>(faults.size()),
                    "fitting " + observer.name);
  });
  return compared;
}

// Every step needs what earlier ones have set: FitFaults() the deviations of
// the normal observer, FindGroups() limits and interpolation errors.
//
// @param like null: what the faults look like is to be found.
ModelSet Assemble(const Healthy& fitted,
                  const std::vector<TrainingRun>& healthy,
                  const std::vector<FaultCondition>& faults,
                  const FaultySource& faulty_by, const TrainingOptions& options,
                  Reporter& reporter, const ModelSet* like = nullptr) {
  ModelSet models = Describe(healthy, fitted.normal, faults, options);
  const NormalResiduals held_out =
      CalibrateHealthy(fitted, options, models.observers.front());
  const std::vector<Condition> compared =
      FitFaults(fitted, faults, faulty_by, options, reporter, models);
  reporter.Report(kNormalShare + kObserverShare, "comparing faults");
  FitLimits(fitted, held_out, options, models);
  FitInterpolationErrors(compared, options.threads, models);
  SetFitBounds(compared, options.threads, models);
  SetAccounting(compared, options.threads, models);
  if (like == nullptr) {
    FindGroups(compared, options.threads, models);
  } else {
    models.groups = like->groups;
    models.undetectable = like->undetectable;
  }
  Validate(models);
  reporter.Report(1.0, "done");
  return models;
}

// Regressors and number of rules of `like`, fitted to other data.
TsModel FitLike(const TsModel& like, double saturation, ChannelPlan plan,
                const Condition& normal, const FitOptions& options) {
  plan.rule_counts = {static_cast<int>(like.rules.size())};
  FitOptions fixed = FitOptionsOf(plan, options);
  fixed.rules.min_rules = plan.rule_counts.front();
  return FitChannel(plan, like.regressors, normal, fixed, saturation);
}

}  // namespace

ModelSet TrainDifferenceSet(const std::vector<TrainingRun>& healthy,
                            const std::vector<FaultCondition>& faults,
                            const FaultSynthesis& synthesize, double flow_limit,
                            const TrainingOptions& options,
                            const Progress& progress,
                            FaultyStretches* simulated) {
  Require(!options.channels.empty(), "a model set needs a channel");
  Require(faults.size() < kMaxObservers, "there are too many faults");
  Reporter reporter(progress);
  reporter.Report(0.0, "fitting the normal observer");
  const Healthy fitted = FitHealthy(healthy, flow_limit, options);
  if (simulated != nullptr) {
    simulated->healthy = fitted.stretches;
    simulated->faulty.resize(faults.size());
  }
  // Each fault is asked for once, and writes only its own entry.
  const auto faulty_by = [&](std::size_t i) {
    std::vector<Stretch> faulty =
        Synthesize(faults[i], fitted.stretches, synthesize);
    if (simulated != nullptr) {
      simulated->faulty[i] = faulty;
    }
    return faulty;
  };
  return Assemble(fitted, healthy, faults, faulty_by, options, reporter);
}

ModelSet RetrainDifferenceSet(const ModelSet& like,
                              const std::vector<TrainingRun>& healthy,
                              const std::vector<FaultCondition>& faults,
                              const FaultyStretches& simulated,
                              const TrainingOptions& options) {
  Healthy fitted;
  fitted.normal = BuildConditions(healthy, options.dataset).front();
  fitted.stretches = simulated.healthy;
  fitted.channels.resize(options.channels.size());
  ParallelFor(
      static_cast<int>(fitted.channels.size()), options.threads, [&](int c) {
        const auto i = static_cast<std::size_t>(c);
        const TsModel& normal = like.observers.front().channels[i].model;
        const ChannelObserver& fault = like.observers.back().channels[i];
        NormalChannel& channel = fitted.channels[i];
        channel.difference = fault.difference;
        channel.plan = fault.difference
                           ? OwnPastPlan(options.channels[i], normal.regressors)
                           : options.channels[i];
        channel.normal = FitLike(normal, normal.saturation, channel.plan,
                                 fitted.normal, options.fit);
        channel.inputs =
            fault.difference
                ? FitLike(fault.model, normal.saturation, options.channels[i],
                          fitted.normal, options.fit)
                : channel.normal;
        PrepareFaults(fitted.stretches, channel);
      });
  const Progress none;
  Reporter reporter(none);
  return Assemble(
      fitted, healthy, faults,
      [&](std::size_t i) { return simulated.faulty[i]; }, options, reporter,
      &like);
}

namespace {

bool SameAntecedents(const Observer& normal, const Observer& fault) {
  for (std::size_t c = 0; c < normal.channels.size(); ++c) {
    if (!fault.channels[c].difference &&
        !SharesAntecedents(normal.channels[c].model, fault.channels[c].model)) {
      return false;
    }
  }
  return true;
}

double ShareWithin(const ValidityRegion& region,
                   const std::vector<TrainingRun>& runs) {
  double inside = 0.0;
  double all = 0.0;
  const auto holds = [](const SignalRange& range, double value) {
    return range.minimum <= value && value <= range.maximum;
  };
  for (const TrainingRun& run : runs) {
    for (const LabelledSample& labelled : run.samples) {
      const Sample& sample = labelled.sample;
      using enum Signal;
      all += 1.0;
      inside += holds(region.cv, sample[kCv]) &&
                (!sample.Has(kT1) || holds(region.t1, sample[kT1])) &&
                (!sample.Has(kP1) || !sample.Has(kP2) ||
                 holds(region.dp, sample[kP1] - sample[kP2]));
    }
  }
  return inside / std::max(1.0, all);
}

// The normal models of the type, fitted to the new runs.
// Stretches and adaptations stay empty: no fault is simulated or fitted.
Healthy RefitHealthy(const ModelSet& of_type,
                     const std::vector<TrainingRun>& runs,
                     const TrainingOptions& options) {
  Healthy healthy;
  healthy.normal = BuildConditions(runs, options.dataset).front();
  healthy.channels.resize(options.channels.size());
  ParallelFor(
      static_cast<int>(options.channels.size()), options.threads, [&](int c) {
        const auto i = static_cast<std::size_t>(c);
        const TsModel& model = of_type.observers.front().channels[i].model;
        NormalChannel& channel = healthy.channels[i];
        channel.plan = IsFreeRunning(model)
                           ? OwnPastPlan(options.channels[i], model.regressors)
                           : options.channels[i];
        channel.plan.rule_counts = {static_cast<int>(model.rules.size())};
        channel.normal = FitChannel(
            channel.plan, model.regressors, healthy.normal,
            FitOptionsOf(channel.plan, options.fit), model.saturation);
      });
  return healthy;
}

// The effect of a fault relative to the normal model of the same antecedents.
// With common weights w_k(x) it is again a Takagi-Sugeno model,
//
//     Σ_k w_k (a_kᵀx + b_k) − Σ_k w_k (a_0kᵀx + b_0k)
//         = Σ_k w_k ((a_k − a_0k)ᵀx + b_k − b_0k);
//
// with different ones it is not, which is why IsTransferable() asks for the
// same antecedents. Its output is within [min − max_0, max − min_0].
TsModel Difference(TsModel fault, const TsModel& normal) {
  for (std::size_t i = 0; i < fault.rules.size(); ++i) {
    TsRule& rule = fault.rules[i];
    const TsRule& without = normal.rules[i];
    rule.intercept -= without.intercept;
    for (std::size_t j = 0; j < rule.slopes.size(); ++j) {
      rule.slopes[j] -= without.slopes[j];
    }
  }
  const double low = fault.output_min - normal.output_max;
  fault.output_max -= normal.output_min;
  fault.output_min = low;
  return fault;
}

// As in FitDifference(), the variance of a residual is that of the background
// plus that of the error of δ_i. The type knows the latter as s_i² − s_0², to
// which the background of this valve is added. That difference of two estimates
// may be negative, hence the lower bound. Evidence is divided by the
// correlation time, so that the longer one of fault and normal observer is the
// cautious one.
ChannelObserver Transfer(ChannelObserver fault, const ChannelObserver& of_type,
                         const ChannelObserver& normal) {
  if (!fault.difference) {
    fault.model = Difference(std::move(fault.model), of_type.model);
    fault.difference = true;
  }
  const auto square = [](double value) { return value * value; };
  const double own =
      std::max(square(kMinDeviation * normal.residual_sd),
               square(fault.residual_sd) - square(of_type.residual_sd) +
                   square(normal.residual_sd));
  const double factor = std::sqrt(own) / fault.residual_sd;
  fault.residual_sd *= factor;
  for (double* corner : {&fault.membership.a, &fault.membership.b,
                         &fault.membership.c, &fault.membership.d}) {
    *corner *= factor;
  }
  fault.correlation_time =
      std::max(fault.correlation_time, normal.correlation_time);
  return fault;
}

}  // namespace

bool IsTransferable(const ModelSet& of_type,
                    const std::vector<TrainingRun>& healthy,
                    const TrainingOptions& options) {
  constexpr double kMinShare = 0.95;
  const bool same_channels =
      std::ranges::equal(of_type.channels, options.channels, {},
                         &ChannelSpec::name, &ChannelPlan::name);
  return same_channels && of_type.sample_period_s == healthy.front().period_s &&
         of_type.flow_unit == healthy.front().flow_unit &&
         std::ranges::all_of(of_type.observers,
                             [&](const Observer& fault) {
                               return SameAntecedents(of_type.observers.front(),
                                                      fault);
                             }) &&
         ShareWithin(of_type.validity, healthy) >= kMinShare;
}

ModelSet TransferDifferenceSet(const ModelSet& of_type,
                               const std::vector<TrainingRun>& healthy,
                               const TrainingOptions& options,
                               const Progress& progress) {
  Reporter reporter(progress);
  reporter.Report(0.0, "fitting the normal observer");
  const Healthy fitted = RefitHealthy(of_type, healthy, options);
  ModelSet models = Describe(healthy, fitted.normal, {}, options);
  models.faults = of_type.faults;
  std::erase_if(models.faults, IsFinding);
  AddSimulated(models);
  AddFindings(models);
  reporter.Report(0.5, "setting the limits");
  FitLimits(fitted, CalibrateHealthy(fitted, options, models.observers.front()),
            options, models);
  for (std::size_t i = 1; i < of_type.observers.size(); ++i) {
    models.observers.push_back(of_type.observers[i]);
    const Observer& normal = models.observers.front();
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      models.observers[i].channels[c] =
          Transfer(of_type.observers[i].channels[c],
                   of_type.observers.front().channels[c], normal.channels[c]);
    }
  }
  models.groups = of_type.groups;
  models.undetectable = of_type.undetectable;
  Validate(models);
  reporter.Report(1.0, "done");
  return models;
}

}  // namespace fdi::trainer
