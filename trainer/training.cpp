#include "trainer/training.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <numeric>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "trainer/calibration.h"
#include "trainer/cross_validation.h"
#include "trainer/observer_adaptation.h"
#include "trainer/parallel_for.h"
#include "trainer/regression.h"
#include "trainer/separability.h"
#include "trainer/validity.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kFewResiduals = 20;
constexpr double kLeastSd = 1e-6;
constexpr double kLeastDeviation = 0.2;  // of the normal residual's

// Shares of the work, for the progress bar.
constexpr double kStructureShare = 0.3;
constexpr double kObserverShare = 0.5;

class Reporter {
 public:
  explicit Reporter(const Progress& progress) : progress_(progress) {}

  void Tell(double share, std::string_view stage) {
    const std::scoped_lock lock(mutex_);
    if (progress_) {
      progress_(share, stage);
    }
  }

 private:
  const Progress& progress_;
  std::mutex mutex_;
};

std::string ObserverName(const Condition& condition) {
  if (condition.fault == 0) {
    return "normal";
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), " %.2f", condition.strength);
  return FaultName(condition.fault) + text.data();
}

// @param least Lower bound on the deviation of the residual: what a stop or a
// transmitter at its limit holds still now moves again with the next sample.
ChannelObserver Calibrate(TsModel model, std::span<const double> residuals,
                          std::span<const double> outputs, double least) {
  ChannelObserver channel;
  channel.validation = Figures(residuals, outputs);
  channel.model = std::move(model);
  if (residuals.empty()) {  // always at the limit of the transmitter
    channel.residual_sd = least;
    channel.membership = {-4.0 * least, -2.0 * least, 2.0 * least, 4.0 * least};
    return channel;
  }
  channel.membership = FitMembership(residuals);
  channel.membership.a = std::min(channel.membership.a, -4.0 * least);
  channel.membership.b = std::min(channel.membership.b, -2.0 * least);
  channel.membership.c = std::max(channel.membership.c, 2.0 * least);
  channel.membership.d = std::max(channel.membership.d, 4.0 * least);
  channel.residual_sd = std::max(std::sqrt(channel.validation.mse), least);
  channel.correlation_time = CorrelationTime(residuals);
  return channel;
}

// By the residuals of the validation stretches, of all stretches where those
// are too short to tell anything.
ChannelObserver Calibrate(TsModel model, const Condition& condition,
                          int settling, double least) {
  std::vector<double> residuals;
  std::vector<double> outputs;
  const auto add = [&](std::span<const Stretch> stretches) {
    for (const Stretch& stretch : stretches) {
      const std::vector<double> r = RunResiduals(model, stretch, settling);
      const std::vector<double> y = RunOutputs(model, stretch, settling);
      residuals.insert(residuals.end(), r.begin(), r.end());
      outputs.insert(outputs.end(), y.begin(), y.end());
    }
  };
  add(condition.validation);
  if (residuals.size() < kFewResiduals) {
    add(condition.training);
  }
  return Calibrate(std::move(model), residuals, outputs, least);
}

ChannelObserver FitObserver(const ChannelPlan& plan,
                            const ChannelObserver& normal_channel,
                            const Condition& normal, const Condition& condition,
                            const FitOptions& options) {
  const TsModel& normal_model = normal_channel.model;
  const double least = kLeastDeviation * normal_channel.residual_sd;
  if (!plan.adapted || RunsOnItself(normal_model)) {
    return Calibrate(
        FitFaultChannel(plan, normal_model, normal, condition, options),
        condition, options.settling, least);
  }
  AdaptedModel adapted = AdaptModel(normal_model, condition);
  return Calibrate(std::move(adapted.model), adapted.residuals, adapted.outputs,
                   least);
}

ModelSet Describe(const std::vector<TrainingRun>& runs,
                  const std::vector<Condition>& conditions,
                  const TrainingOptions& options) {
  ModelSet models;
  models.name = options.name;
  models.created_ns = options.created_ns;
  models.software = options.software;
  models.preset = options.preset;
  models.sample_period_s = runs.front().period_s;
  models.flow_unit = runs.front().flow_unit;
  models.validity = TrainedRegion(conditions);
  models.decision = options.decision;
  for (const ChannelPlan& plan : options.channels) {
    models.channels.push_back({plan.name, plan.output, -1.0, 1.0});
  }
  for (const Condition& condition : conditions) {
    models.observers.push_back(
        {ObserverName(condition), condition.fault, condition.strength,
         std::vector<ChannelObserver>(options.channels.size())});
    if (condition.fault != 0 &&
        (models.faults.empty() || models.faults.back() != condition.fault)) {
      models.faults.push_back(condition.fault);
    }
  }
  for (const TrainingRun& run : runs) {
    models.training_runs.push_back(run.id);
  }
  return models;
}

// The normal observer's membership and deviation rest on all its data.
void CalibrateNormal(const std::vector<ResidualSeries>& series,
                     Observer& normal) {
  for (std::size_t c = 0; c < series.size(); ++c) {
    const std::vector<double> residuals = Joined(series[c]);
    ChannelObserver& channel = normal.channels[c];
    double square = 0.0;
    for (const double r : residuals) {
      square += r * r;
    }
    channel.membership = FitMembership(residuals);
    channel.residual_sd = std::max(
        std::sqrt(square / static_cast<double>(residuals.size())), 1e-6);
    channel.correlation_time = CorrelationTime(residuals);
  }
}

// The options of one channel.
FitOptions FitOptionsOf(const TrainingOptions& options, std::size_t channel) {
  FitOptions fit = options.fit;
  const std::vector<int>& counts = options.channels[channel].rule_counts;
  if (!counts.empty()) {
    fit.rules.counts = counts;
    fit.rules.min_rules = *std::min_element(counts.begin(), counts.end());
  }
  return fit;
}

}  // namespace

ModelSet TrainModelSet(const std::vector<TrainingRun>& runs,
                       const TrainingOptions& options,
                       const Progress& progress) {
  Require(!options.channels.empty(), "a model set needs a channel");
  Reporter reporter(progress);
  const std::vector<Condition> conditions =
      BuildConditions(runs, options.dataset);
  ModelSet models = Describe(runs, conditions, options);
  const int channels = static_cast<int>(options.channels.size());
  std::vector<std::vector<Regressor>> regressors(options.channels.size());
  std::vector<double> saturations(options.channels.size());
  reporter.Tell(0.0, "choosing regressors");
  ParallelFor(channels, options.threads, [&](int c) {
    const auto i = static_cast<std::size_t>(c);
    saturations[i] = FindSaturation(options.channels[i], conditions);
    regressors[i] = ChooseRegressors(options.channels[i], conditions.front(),
                                     options.fit, saturations[i]);
  });
  Observer& normal = models.observers.front();
  ParallelFor(channels, options.threads, [&](int c) {
    const auto i = static_cast<std::size_t>(c);
    normal.channels[i] = Calibrate(
        FitChannel(options.channels[i], regressors[i], conditions.front(),
                   FitOptionsOf(options, i), saturations[i]),
        conditions.front(), options.fit.settling, kLeastSd);
  });
  const int fits = static_cast<int>(conditions.size() - 1) * channels;
  std::atomic<int> done{0};
  ParallelFor(fits, options.threads, [&](int i) {
    const auto o = static_cast<std::size_t>(1 + i / channels);
    const auto c = static_cast<std::size_t>(i % channels);
    models.observers[o].channels[c] =
        FitObserver(options.channels[c], normal.channels[c], conditions.front(),
                    conditions[o], options.fit);
    reporter.Tell(kStructureShare + kObserverShare * ++done / fits,
                  "fitting " + models.observers[o].name);
  });
  reporter.Tell(kStructureShare + kObserverShare, "setting thresholds");
  const NormalResiduals normal_data =
      CrossValidate(conditions.front(), models.observers.front(),
                    options.channels, options.fit, options.threads);
  CalibrateNormal(normal_data.residuals, models.observers.front());
  std::vector<std::vector<int>> windows;
  for (const ChannelPlan& plan : options.channels) {
    windows.push_back(plan.windows);
  }
  FitThresholds(normal_data.residuals, windows, options.false_alarms_per_hour,
                models, normal_data.commands);
  reporter.Tell(0.9, "comparing faults");
  FitInterpolationErrors(conditions, models);
  FindGroups(conditions, models);
  Validate(models);
  reporter.Tell(1.0, "done");
  return models;
}

}  // namespace fdi::trainer
