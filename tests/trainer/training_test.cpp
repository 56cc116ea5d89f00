#include "trainer/training.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/trainer/gaussian.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {
namespace {

// A valve whose X follows CV with a lag and whose F falls with X. f19 scales
// the reading of F, f6 adds to it, f8 does nothing.
TrainingRun Simulate(int fault, double strength, int begin, int count,
                     std::uint64_t seed) {
  const auto n = static_cast<std::size_t>(count);
  const std::vector<double> noise = GaussianSeries(4 * n, seed);
  TrainingRun run;
  run.id = "run" + std::to_string(seed);
  double x = 50.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double t = static_cast<double>(k);
    const double cv = 50.0 +
                      20.0 * std::sin(2.0 * std::numbers::pi * t / 70.0) +
                      2.0 * noise[4 * k];
    const bool acts = static_cast<int>(k) >= begin && fault != 0;
    double flow = 0.4 * (100.0 - x);
    flow = acts && fault == 19 ? flow * (1.0 - strength) : flow;
    flow = acts && fault == 6 ? flow + 10.0 * strength : flow;
    LabelledSample labelled;
    Sample& sample = labelled.sample;
    sample.stamp_ns = static_cast<std::int64_t>(k) * 1'000'000'000;
    sample.source_id = seed;
    sample.seq = k;
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kP1, 3500.0 + noise[4 * k + 1]);
    sample.Set(Signal::kX, x + 0.2 * noise[4 * k + 2]);
    sample.Set(Signal::kF, flow + 0.2 * noise[4 * k + 3]);
    labelled.truth = FaultTruth{fault, acts ? strength : 0.0};
    run.samples.push_back(labelled);
    x += 0.6 * (cv - x);
  }
  return run;
}

std::vector<TrainingRun> Runs() {
  return {Simulate(0, 0.0, 0, 3000, 1),   Simulate(19, 0.3, 300, 900, 2),
          Simulate(19, 0.6, 300, 900, 3), Simulate(6, 0.5, 300, 900, 4),
          Simulate(6, 1.0, 300, 900, 5),  Simulate(8, 0.5, 300, 900, 6)};
}

TrainingOptions Options(int threads) {
  TrainingOptions options = PresetOptions("paper");
  options.name = "test";
  options.threads = threads;
  options.fit.rules.max_rules = 2;
  return options;
}

const ModelSet& Trained() {
  static const ModelSet models = TrainModelSet(Runs(), Options(2));
  return models;
}

std::vector<int> FinalSet(int fault, double strength, std::uint64_t seed) {
  const auto models = std::make_shared<const ModelSet>(Trained());
  return ComputeIndices(
             ScoreRun(models, Simulate(fault, strength, 200, 500, seed)))
      .final_set;
}

TEST(TrainingTest, OneObserverPerConditionTheNormalOneFirst) {
  const ModelSet& models = Trained();
  ASSERT_EQ(models.observers.size(), 6U);
  EXPECT_EQ(models.observers[0].name, "normal");
  EXPECT_EQ(models.observers[1].name, "f6 0.50");
  EXPECT_EQ(models.observers[5].name, "f19 0.60");
  EXPECT_EQ(models.faults,
            (std::vector<int>{6, 8, 19, 201, 202, 203, 204, 205, 206}));
  EXPECT_GT(models.observers[0].channels[0].validation.vaf, 99.0);
  EXPECT_GT(models.observers[0].channels[1].validation.vaf, 99.0);
}

TEST(TrainingTest, AValveThatIsBackIsLeftAloneForMinutes) {
  const ModelSet& models = Trained();
  EXPECT_EQ(models.validity.rearm_samples,
            std::max(60, static_cast<int>(200.0 / models.sample_period_s)));
}

TEST(TrainingTest, FaultsAreNamedAtTrainedAndUntrainedStrengths) {
  EXPECT_EQ(FinalSet(19, 0.6, 11), std::vector<int>{19});
  EXPECT_EQ(FinalSet(19, 0.45, 12), std::vector<int>{19});
  EXPECT_EQ(FinalSet(6, 0.5, 13), std::vector<int>{6});
  EXPECT_EQ(FinalSet(6, 0.75, 14), std::vector<int>{6});
}

TEST(TrainingTest, FaultWithoutEffectIsUndetectable) {
  EXPECT_EQ(Trained().undetectable, std::vector<int>{8});
  EXPECT_TRUE(FinalSet(8, 0.5, 15).empty());
}

TEST(TrainingTest, ConditionLikeTheNormalOneTakesTheNormalModel) {
  const TrainingOptions options = Options(1);
  const ChannelPlan& plan = options.channels[0];
  const Condition normal = BuildConditions(Runs()).front();
  Condition alike = normal;
  alike.fault = 8;
  const std::vector<Regressor> regressors{{Signal::kCv, 1}, {Signal::kX, 1}};
  const TsModel model = FitChannel(plan, regressors, normal, options.fit);
  const TsModel fault =
      FitFaultChannel(plan, model, normal, alike, options.fit);
  EXPECT_EQ(fault.rules[0].slopes, model.rules[0].slopes);
  EXPECT_EQ(fault.rules[0].intercept, model.rules[0].intercept);
}

TEST(TrainingTest, ConditionUnlikeTheNormalOneGetsItsOwnModel) {
  const TrainingOptions options = Options(1);
  const ChannelPlan& plan = options.channels[1];
  const std::vector<Condition> conditions = BuildConditions(Runs());
  const std::vector<Regressor> regressors{{Signal::kX, 0}};
  const TsModel model =
      FitChannel(plan, regressors, conditions[0], options.fit);
  ASSERT_EQ(conditions[5].fault, 19);
  const TsModel fault =
      FitFaultChannel(plan, model, conditions[0], conditions[5], options.fit);
  EXPECT_NEAR(fault.rules[0].slopes[0], 0.4 * model.rules[0].slopes[0], 0.02);
}

TEST(TrainingTest, ThreadsDoNotChangeTheResult) {
  const ModelSet alone = TrainModelSet(Runs(), Options(1));
  const ModelSet& both = Trained();
  ASSERT_EQ(alone.observers.size(), both.observers.size());
  for (std::size_t i = 0; i < alone.observers.size(); ++i) {
    for (std::size_t c = 0; c < 2; ++c) {
      const ChannelObserver& a = alone.observers[i].channels[c];
      const ChannelObserver& b = both.observers[i].channels[c];
      EXPECT_EQ(a.validation.mse, b.validation.mse);
      EXPECT_EQ(a.membership.a, b.membership.a);
      EXPECT_EQ(a.model.rules[0].intercept, b.model.rules[0].intercept);
    }
  }
  EXPECT_EQ(alone.channels[0].upper_threshold,
            both.channels[0].upper_threshold);
}

TEST(TrainingTest, ProgressRisesToOne) {
  double last = 0.0;
  TrainingOptions options = Options(1);
  options.fit.rules.max_rules = 1;
  TrainModelSet(Runs(), options, [&](double share, std::string_view) {
    EXPECT_GE(share, last);
    last = share;
  });
  EXPECT_EQ(last, 1.0);
}

TEST(TrainingTest, UnknownPresetNamesTheKnownOnes) {
  try {
    PresetOptions("papr");
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_NE(std::string(error.what()).find("expected paper"),
              std::string::npos);
  }
}

}  // namespace
}  // namespace fdi::trainer
