#include "trainer/difference_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "trainer/observer_calibration.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kWorthOwnPast = 0.98;   // of the error without
constexpr double kLowestPosition = 0.0;  // ends of the position transmitter [%]
constexpr double kHighestPosition = 100.0;

// The plan of a normal model that runs on its own past.
ChannelPlan OwnPastPlan(const ChannelPlan& plan) {
  ChannelPlan own = plan;
  own.pools = {plan.own_past_pool};
  own.antecedents.clear();
  own.rule_counts = {1, 4, 8, 16};
  own.parallel = true;
  return own;
}

TsModel FitPlan(const ChannelPlan& plan, const Condition& normal,
                const TrainingOptions& options, double saturation) {
  return FitChannel(plan,
                    ChooseRegressors(plan, normal, options.fit, saturation),
                    normal, FitOptionsOf(plan, options.fit), saturation);
}

bool AtLimit(const TsModel& normal, double reading) {
  return reading >= normal.saturation ||
         (normal.output == Signal::kX &&
          (reading <= kLowestPosition || reading >= kHighestPosition));
}

std::vector<std::vector<double>> PredictAll(
    const TsModel& model, const std::vector<Stretch>& stretches) {
  std::vector<std::vector<double>> predictions;
  for (const Stretch& stretch : stretches) {
    predictions.push_back(RunPredictions(model, stretch));
  }
  return predictions;
}

// What the fault makes of a reading without the background of the valve;
// readings at a limit stay.
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
    targets.validation.push_back({faulty[i].run_id, {}});
  }
  return targets;
}

// The rules of `inputs` without anything to say.
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
      const double r = Residual(channel.normal, reading, predictions[k]);
      if (!std::isnan(r)) {
        readings.residuals.push_back(r);
        readings.outputs.push_back(reading);
      }
    }
  }
  return readings;
}

// What δ_i or ŷ_i is adapted from.
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
  if (plan.own_past_pool.empty()) {
    return channel;
  }
  const ChannelPlan own_plan = OwnPastPlan(plan);
  TsModel own = FitPlan(own_plan, normal, options, saturation);
  if (RunsOnItself(own) && error(own) < kWorthOwnPast * error(channel.normal)) {
    channel.plan = own_plan;
    channel.normal = std::move(own);
    channel.difference = true;
  }
  return channel;
}

}  // namespace

NormalChannel FitNormalChannel(const ChannelPlan& plan, const Condition& normal,
                               const std::vector<Stretch>& healthy,
                               const TrainingOptions& options,
                               double saturation) {
  NormalChannel channel = ChooseNormal(plan, normal, options, saturation);
  channel.expected = PredictAll(channel.normal, healthy);
  channel.adaptation.emplace(Base(channel), Whole(healthy));
  return channel;
}

ChannelObserver FitDifference(const NormalChannel& channel,
                              const ChannelObserver& normal_observer,
                              const std::vector<Stretch>& healthy,
                              const std::vector<Stretch>& faulty,
                              const FaultCondition& fault, int settling) {
  const Predictions base = BaseOf(channel, faulty);
  const Condition targets = Targets(channel, healthy, faulty, base, fault);
  const AdaptedModel adapted = channel.adaptation->Serves(targets)
                                   ? channel.adaptation->Fit(targets)
                                   : AdaptModel(Base(channel), targets);
  Readings readings =
      RunObserver(channel, adapted.model, faulty, base, settling);
  const double sd = normal_observer.residual_sd;
  const double held_out = sd * sd + MeanSquare(adapted.residuals);
  const double widening = std::max(
      1.0,
      std::sqrt(held_out / std::max(MeanSquare(readings.residuals), 1e-12)));
  for (double& residual : readings.residuals) {
    residual *= widening;
  }
  ChannelObserver observer =
      CalibrateChannel(adapted.model, readings.residuals, readings.outputs,
                       kLeastDeviation * sd);
  observer.difference = channel.difference;
  return observer;
}

}  // namespace fdi::trainer
