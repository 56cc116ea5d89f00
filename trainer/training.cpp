#include "trainer/training.h"

#include <atomic>

#include "base/error.h"
#include "base/parallel_for.h"
#include "diagnosis/observers/drift_watch.h"
#include "trainer/calibration.h"
#include "trainer/dead_bands.h"
#include "trainer/model_set_description.h"
#include "trainer/observer_adaptation.h"
#include "trainer/observer_calibration.h"

namespace fdi::trainer {
namespace {

// Shares of the work, for the progress bar.
constexpr double kStructureShare = 0.3;
constexpr double kFitShare = 0.5;

// One channel of the observer of a fault: the normal model of the channel,
// adapted to the data of the fault, where the plan says so and that model does
// not run on its own predictions; otherwise the simplest model that explains
// them (FitFaultChannel).
ChannelObserver FitObserver(const ChannelPlan& plan,
                            const ChannelObserver& normal_channel,
                            const Condition& normal, const Condition& condition,
                            const FitOptions& options) {
  const TsModel& normal_model = normal_channel.model;
  const double least = kMinDeviation * normal_channel.residual_sd;
  if (!plan.adapted || IsFreeRunning(normal_model)) {
    return CalibrateOn(
        FitFaultChannel(plan, normal_model, normal, condition, options),
        condition, options.settling, least);
  }
  AdaptedModel adapted = AdaptModel(normal_model, condition);
  return CalibrateChannel(std::move(adapted.model), adapted.residuals,
                          adapted.outputs, least);
}

// A signal that is not there reads 0, to which any model can be fitted.
void RequireOutputs(const std::vector<TrainingRun>& runs,
                    const std::vector<ChannelPlan>& channels) {
  for (const TrainingRun& run : runs) {
    for (const ChannelPlan& plan : channels) {
      if (!run.samples.empty() &&
          !run.samples.front().sample.Has(plan.output)) {
        throw DataError(
            "run " + run.id + " has no " +
            std::string(SignalName(plan.output)) + ", which the channel " +
            plan.name +
            " predicts: fdi-trainer onboard takes what a valve measures");
      }
    }
  }
}

}  // namespace

ModelSet TrainModelSet(const std::vector<TrainingRun>& runs,
                       const TrainingOptions& options,
                       const Progress& progress) {
  Require(!options.channels.empty(), "a model set needs a channel");
  RequireOutputs(runs, options.channels);
  Reporter reporter(progress);
  const std::vector<Condition> conditions =
      BuildConditions(runs, options.dataset);
  ModelSet models = DescribeModelSet(runs, conditions, options);
  for (const Condition& condition : conditions) {
    AddObserver(condition.fault, condition.strength, models);
  }
  AddFindings(models);
  AddDriftFinding(models);
  const int channels = static_cast<int>(options.channels.size());
  std::vector<std::vector<Regressor>> regressors(options.channels.size());
  std::vector<double> saturations(options.channels.size());
  reporter.Report(0.0, "choosing regressors");
  ParallelFor(channels, options.threads, [&](int c) {
    const auto i = static_cast<std::size_t>(c);
    saturations[i] = FindSaturation(options.channels[i], conditions);
    regressors[i] = ChooseRegressors(options.channels[i], conditions.front(),
                                     options.fit, saturations[i]);
  });
  Observer& normal = models.observers.front();
  ParallelFor(channels, options.threads, [&](int c) {
    const auto i = static_cast<std::size_t>(c);
    normal.channels[i] = CalibrateOn(
        FitChannel(options.channels[i], regressors[i], conditions.front(),
                   FitOptionsOf(options.channels[i], options.fit),
                   saturations[i]),
        conditions.front(), options.fit.settling, kMinSd);
  });
  const int fits = static_cast<int>(conditions.size() - 1) * channels;
  std::atomic<int> done{0};
  ParallelFor(fits, options.threads, [&](int i) {
    const auto o = 1 + static_cast<std::size_t>(i / channels);
    const auto c = static_cast<std::size_t>(i % channels);
    models.observers[o].channels[c] =
        FitObserver(options.channels[c], normal.channels[c], conditions.front(),
                    conditions[o], options.fit);
    reporter.Report(kStructureShare + kFitShare * ++done / fits,
                    "fitting " + models.observers[o].name);
  });
  reporter.Report(kStructureShare + kFitShare, "setting thresholds");
  // Residuals on data that the models were not fitted to: on its own data a
  // model is better than ever in service, and thresholds would be too close.
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
  CoverDeadBands(conditions.front(), models);
  reporter.Report(0.9, "comparing faults");
  FitInterpolationErrors(conditions, options.threads, models);
  SetFitBounds(conditions, options.threads, models);
  FindGroups(conditions, options.threads, models);
  Validate(models);
  reporter.Report(1.0, "done");
  return models;
}

}  // namespace fdi::trainer
