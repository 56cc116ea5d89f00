#include "trainer/difference_observers.h"

#include <algorithm>
#include <atomic>

#include "diagnosis/error.h"
#include "trainer/calibration.h"
#include "trainer/cross_validation.h"
#include "trainer/difference_fit.h"
#include "trainer/model_set_description.h"
#include "trainer/observer_calibration.h"
#include "trainer/parallel_for.h"
#include "trainer/reporter.h"
#include "trainer/separability.h"

namespace fdi::trainer {
namespace {

constexpr double kLimitShare = 0.005;  // of the range of the transmitter

// Shares of the work, for the progress bar.
constexpr double kNormalShare = 0.1;
constexpr double kObserverShare = 0.75;

// Blocks of 600 samples, evenly spread, where there are more than 3600 in all:
// faults are exact, and more of the same tells nothing about them.
std::vector<Stretch> Excerpt(const std::vector<Stretch>& stretches) {
  constexpr std::size_t kBlock = 600;
  constexpr std::size_t kMost = 3600;
  if (CountSamples(stretches) <= static_cast<std::int64_t>(kMost)) {
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
  if (blocks.size() * kBlock <= kMost) {
    return blocks.empty() ? stretches : blocks;
  }
  std::vector<Stretch> chosen;
  for (std::size_t i = 0; i < kMost / kBlock; ++i) {
    chosen.push_back(std::move(blocks[i * blocks.size() * kBlock / kMost]));
  }
  return chosen;
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

// A model on its own past errs after a large move of the command, one way or
// the other: some hours may hold the largest errors of one way alone.
void BalanceThresholds(ModelSet& models) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    if (RunsOnItself(models.observers.front().channels[c].model)) {
      ChannelSpec& channel = models.channels[c];
      channel.upper_threshold =
          std::max(channel.upper_threshold, -channel.lower_threshold);
      channel.lower_threshold = -channel.upper_threshold;
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
  return models;
}

// What the healthy runs give: the stretches that faults are put onto, and the
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
  std::vector<ChannelPlan> plans;
  for (std::size_t c = 0; c < healthy.channels.size(); ++c) {
    plans.push_back(healthy.channels[c].plan);
    observer.channels[c] =
        CalibrateOn(healthy.channels[c].normal, healthy.normal,
                    options.fit.settling, kLeastSd);
  }
  NormalResiduals held_out = CrossValidate(healthy.normal, observer, plans,
                                           options.fit, options.threads);
  CalibrateNormal(held_out.residuals, observer);
  return held_out;
}

// Fits the observer of every fault. Returns the data on which faults are
// compared, parallel to the observers.
std::vector<Condition> FitFaults(const Healthy& healthy,
                                 const std::vector<FaultCondition>& faults,
                                 const FaultSynthesis& synthesize,
                                 const TrainingOptions& options,
                                 Reporter& reporter, ModelSet& models) {
  std::vector<Condition> compared(faults.size() + 1);
  compared.front() = healthy.normal;
  std::atomic<int> done{0};
  ParallelFor(static_cast<int>(faults.size()), options.threads, [&](int i) {
    const FaultCondition& fault = faults[static_cast<std::size_t>(i)];
    Observer& observer = models.observers[static_cast<std::size_t>(i) + 1];
    const std::vector<Stretch> faulty =
        Synthesize(fault, healthy.stretches, synthesize);
    for (std::size_t c = 0; c < healthy.channels.size(); ++c) {
      observer.channels[c] = FitDifference(
          healthy.channels[c], models.observers.front().channels[c],
          healthy.stretches, faulty, fault, options.fit.settling);
    }
    compared[static_cast<std::size_t>(i) + 1] =
        ValidationPart(fault, faulty, options.dataset.validation_share);
    reporter.Tell(kNormalShare + kObserverShare * ++done /
                                     static_cast<double>(faults.size()),
                  "fitting " + observer.name);
  });
  return compared;
}

}  // namespace

ModelSet TrainDifferenceSet(const std::vector<TrainingRun>& healthy,
                            const std::vector<FaultCondition>& faults,
                            const FaultSynthesis& synthesize, double flow_limit,
                            const TrainingOptions& options,
                            const Progress& progress) {
  Require(!options.channels.empty(), "a model set needs a channel");
  Require(faults.size() < kMaxObservers, "there are too many faults");
  Reporter reporter(progress);
  reporter.Tell(0.0, "fitting the normal observer");
  const Healthy fitted = FitHealthy(healthy, flow_limit, options);
  ModelSet models = Describe(healthy, fitted.normal, faults, options);
  const NormalResiduals held_out =
      CalibrateHealthy(fitted, options, models.observers.front());
  const std::vector<Condition> compared =
      FitFaults(fitted, faults, synthesize, options, reporter, models);
  reporter.Tell(kNormalShare + kObserverShare, "comparing faults");
  std::vector<std::vector<int>> windows;
  for (const NormalChannel& channel : fitted.channels) {
    windows.push_back(channel.plan.windows);
  }
  FitThresholds(held_out.residuals, windows, options.false_alarms_per_hour,
                models, held_out.commands);
  BalanceThresholds(models);
  FitInterpolationErrors(compared, models);
  FindGroups(compared, models);
  Validate(models);
  reporter.Tell(1.0, "done");
  return models;
}

}  // namespace fdi::trainer
