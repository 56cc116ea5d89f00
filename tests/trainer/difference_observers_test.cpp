#include "trainer/difference_observers.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/taught.h"
#include "diagnosis/observers/observer_bank.h"
#include "trainer/evaluation.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kFlowNoise = 0.8;

// X follows CV with a lag; F falls with X, with a swell that no model knows.
TrainingRun HealthyRun(unsigned seed, int count) {
  TrainingRun run;
  run.id = "healthy" + std::to_string(seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  double cv = 60.0;
  double x = 60.0;
  for (int k = 0; k < count; ++k) {
    cv = 60.0 + 0.9 * (cv - 60.0) + 2.0 * noise(random);
    x += 0.6 * (cv - x);
    Sample sample;
    sample.stamp_ns = k * 1'000'000'000LL;
    sample.seq = static_cast<std::uint64_t>(k);
    sample.source_id = 1;
    sample.Set(Signal::kCv, cv);
    sample.Set(Signal::kX, x + 0.1 * noise(random));
    sample.Set(Signal::kF, 45.0 - 0.45 * x + 0.5 * std::sin(0.05 * k) +
                               kFlowNoise * noise(random));
    run.samples.push_back({sample, FaultTruth{}});
  }
  return run;
}

// f19: F (1 − s); f13: X (1 + s).
std::vector<Sample> WithFault(const FaultCondition& fault,
                              const Stretch& healthy) {
  std::vector<Sample> samples = healthy.samples;
  for (Sample& sample : samples) {
    const Signal signal = fault.fault == 19 ? Signal::kF : Signal::kX;
    const double factor =
        fault.fault == 19 ? 1.0 - fault.strength : 1.0 + fault.strength;
    sample.Set(signal, sample[signal] * factor);
  }
  return samples;
}

TrainingOptions TwoChannels() {
  TrainingOptions options = PresetOptions("extended");
  options.name = "two";
  options.threads = 1;
  options.channels.resize(2);  // X and F(X)
  options.channels[0].rule_counts = {1, 4};
  options.channels[1].rule_counts = {2};
  options.channels[0].own_past = {
      {{Signal::kCv, 0}, {Signal::kCv, 1}, {Signal::kX, 1}}};
  return options;
}

const ModelSet& Trained() {
  static const ModelSet models = TrainDifferenceSet(
      {HealthyRun(1, 1500)},
      {{13, 0.1}, {13, 0.2}, {19, 0.02}, {19, 0.25}, {19, 0.5}}, WithFault,
      100.0, TwoChannels());
  return models;
}

// x(k) = memory x(k-1) + (1 - memory) CV.
TsModel WithMemory(double memory) {
  TsModel model;
  model.regressors = {{Signal::kX, 1}, {Signal::kCv, 0}};
  model.output_max = 100.0;
  TsRule rule;
  rule.antecedents = {{0.0, 0.0, 1e6, 1e6}, {0.0, 0.0, 1e6, 1e6}};
  rule.slopes = {memory, 1.0 - memory};
  model.rules = {rule};
  return model;
}

// At rest at 50, but for one sample each at 0 and 100 % at the end.
TEST(DifferenceObserversTest, AModelThatDoesNotForgetErrsFromAnyPast) {
  Stretch stretch{"r", {}};
  for (int k = 0; k < 200; ++k) {
    Sample sample;
    sample.Set(Signal::kCv, 50.0);
    sample.Set(Signal::kX, k == 198 ? 0.0 : k == 199 ? 100.0 : 50.0);
    stretch.samples.push_back(sample);
  }
  const std::vector<Stretch> but_last{
      {"r", {stretch.samples.begin(), stretch.samples.end() - 2}}};

  EXPECT_LT(MeanSquare(RunResiduals(WithMemory(0.99), but_last, 30)), 1e-9);
  EXPECT_GT(FreeRunError(WithMemory(0.99), {stretch}), 400.0);
  EXPECT_LT(FreeRunError(WithMemory(0.5), {stretch}), 1.5e2);
}

// Beside x(k) = 0.5 x(k-1) + 0.5 CV there is a rule for positions above 120
// that holds them where they are: from its upper limit the model never comes
// back.
TEST(DifferenceObserversTest, AModelThatMayStayAtItsLimitIsNone) {
  Stretch stretch{"r", {}};
  for (int k = 0; k < 300; ++k) {
    Sample sample;
    sample.Set(Signal::kCv, 50.0);
    sample.Set(Signal::kX, 50.0);
    stretch.samples.push_back(sample);
  }
  TsModel model = WithMemory(0.5);
  model.output_max = 150.0;
  EXPECT_TRUE(ForgetsItsPast(model, {stretch}));

  model.rules[0].antecedents[0] = {-1e6, -1e6, 115.0, 120.0};
  TsRule latch = model.rules[0];
  latch.antecedents[0] = {115.0, 120.0, 1e6, 1e6};
  latch.slopes = {1.0, 0.0};
  model.rules.push_back(latch);
  EXPECT_FALSE(ForgetsItsPast(model, {stretch}));
  EXPECT_LT(MeanSquare(RunResiduals(model, {stretch}, 30)), 1e-9);
  // Too short to tell.
  stretch.samples.pop_back();
  EXPECT_TRUE(ForgetsItsPast(model, {stretch}));
}

// The command leaves its usual range once, for eight samples: models of the
// other three quarters know nothing of how the flow bends there.
TEST(DifferenceObserversTest, OneExcursionOfTheCommandDoesNotSetTheLimits) {
  const auto limits = [](bool excursion) {
    TrainingRun run = HealthyRun(3, 1600);
    std::mt19937 random(4);
    std::normal_distribution<double> noise(0.0, 1.0);
    for (std::size_t k = 0; k < run.samples.size(); ++k) {
      Sample& sample = run.samples[k].sample;
      if (excursion && k >= 900 && k < 908) {
        sample.Set(Signal::kCv, 20.0);
      }
      sample.Set(Signal::kF, 200.0 * std::exp(-0.04 * sample[Signal::kCv]) +
                                 0.3 * noise(random));
    }
    TrainingOptions options = TwoChannels();
    options.channels.resize(1);
    ChannelPlan& plan = options.channels.front();
    plan.name = "F(CV)";
    plan.output = Signal::kF;
    plan.pools = {{{Signal::kCv, 0}}};
    plan.antecedents = {{Signal::kCv, 0}};
    plan.own_past.clear();
    return TrainDifferenceSet({run}, {{19, 0.5}}, WithFault, 200.0, options)
        .channels.front();
  };
  const ChannelSpec with = limits(true);
  const ChannelSpec without = limits(false);
  EXPECT_LT(with.upper_threshold, 1.5 * without.upper_threshold);
  EXPECT_LT(with.windows.front().upper_mean,
            1.5 * without.windows.front().upper_mean);
}

// 2 % of a flow of 18 is half its noise: fitted to the noisy readings the
// observer would err by more than it has to say.
TEST(DifferenceObserversTest, SaysWhatTheFaultChangesWithoutTheNoise) {
  const ModelSet& models = Trained();
  ObserverBank bank(models);
  const TrainingRun run = HealthyRun(2, 400);
  bank.Initialise(run.samples.front().sample);
  for (const LabelledSample& labelled : run.samples) {
    bank.Step(labelled.sample);
    const double normal = bank.prediction(0, 1);
    EXPECT_NEAR(bank.prediction(3, 1), 0.98 * normal, 0.08);
    EXPECT_NEAR(bank.prediction(5, 1), 0.5 * normal, 0.5);
  }
}

TEST(DifferenceObserversTest, FaultObserversFollowTheDynamicsOfTheNormalOne) {
  const ModelSet& models = Trained();
  ASSERT_TRUE(IsFreeRunning(models.observers[0].channels[0].model));
  EXPECT_TRUE(models.observers[2].channels[0].difference);
  EXPECT_FALSE(models.observers[2].channels[1].difference);
  EXPECT_LT(models.observers[2].channels[0].residual_sd, 0.6);
}

// A fault was never seen on this valve, but is named.
void ExpectNamed(const std::shared_ptr<const ModelSet>& models,
                 TrainingRun (*healthy)(unsigned, int)) {
  for (const FaultCondition& fault :
       {FaultCondition{19, 0.35}, FaultCondition{13, 0.15}}) {
    TrainingRun run = healthy(3, 900);
    Stretch stretch{run.id, {}};
    for (const LabelledSample& labelled : run.samples) {
      stretch.samples.push_back(labelled.sample);
    }
    const std::vector<Sample> faulty = WithFault(fault, stretch);
    for (std::size_t k = 300; k < faulty.size(); ++k) {
      run.samples[k] = {faulty[k], FaultTruth{fault.fault, fault.strength}};
    }
    const RunIndices indices = ComputeIndices(ScoreRun(models, run));
    EXPECT_TRUE(indices.detected) << fault.fault;
    EXPECT_EQ(indices.r_fd, 0.0) << fault.fault;
    EXPECT_EQ(indices.final_set, std::vector<int>{fault.fault});
  }
}

// Six records of 590 samples count beside one of 700.
TEST(DifferenceObserversTest, ShortRecordsAreNotLeftOut) {
  std::vector<TrainingRun> runs{HealthyRun(1, 700)};
  for (unsigned seed = 2; seed <= 7; ++seed) {
    runs.push_back(HealthyRun(seed, 590));
  }
  std::size_t samples = 0;
  TrainDifferenceSet(
      runs, {{19, 0.25}},
      [&](const FaultCondition& fault, const Stretch& healthy) {
        samples += healthy.samples.size();
        return WithFault(fault, healthy);
      },
      100.0, TwoChannels());
  EXPECT_GT(samples, 3000U);
}

// A set made for scoring has the structure of the first one, and limits and
// models of the runs that are left. On the same runs it is the same.
TEST(DifferenceObserversTest, ASetForScoringIsFittedToWhatIsLeft) {
  const std::vector<FaultCondition> faults{{13, 0.2}, {19, 0.25}, {19, 0.5}};
  const TrainingRun run = HealthyRun(1, 1200);
  FaultyStretches simulated;
  const ModelSet like = TrainDifferenceSet({run}, faults, WithFault, 100.0,
                                           TwoChannels(), {}, &simulated);
  ASSERT_EQ(simulated.faulty.size(), faults.size());
  const ModelSet same =
      RetrainDifferenceSet(like, {run}, faults, simulated, TwoChannels());
  TrainingRun half = run;
  half.samples.resize(600);
  for (std::size_t i = 0; i <= faults.size(); ++i) {
    Stretch& stretch =
        i == 0 ? simulated.healthy.front() : simulated.faulty[i - 1].front();
    stretch.samples.resize(580);  // 20 are dropped after a start
  }
  const ModelSet rest =
      RetrainDifferenceSet(like, {half}, faults, simulated, TwoChannels());
  ASSERT_EQ(rest.observers.size(), like.observers.size());
  for (std::size_t o = 0; o < like.observers.size(); ++o) {
    for (std::size_t c = 0; c < like.channels.size(); ++c) {
      const ChannelObserver& all = like.observers[o].channels[c];
      const ChannelObserver& again = same.observers[o].channels[c];
      const ChannelObserver& left = rest.observers[o].channels[c];
      EXPECT_EQ(again.residual_sd, all.residual_sd);
      EXPECT_EQ(again.fit, all.fit);
      EXPECT_EQ(left.difference, all.difference);
      EXPECT_EQ(left.model.rules.size(), all.model.rules.size());
      EXPECT_NE(left.residual_sd, all.residual_sd);
    }
  }
  EXPECT_EQ(same.channels[1].upper_threshold, like.channels[1].upper_threshold);
  EXPECT_NE(rest.channels[1].upper_threshold, like.channels[1].upper_threshold);
  EXPECT_NEAR(rest.threshold_hours, like.threshold_hours / 2.0, 0.02);
}

TEST(DifferenceObserversTest, FaultsNeverSeenAreNamed) {
  ExpectNamed(std::make_shared<const ModelSet>(Trained()), HealthyRun);
}

// Passes 5 % more, and its rod stands 1 % further.
TrainingRun FurtherValve(unsigned seed, int count) {
  TrainingRun run = HealthyRun(seed, count);
  for (LabelledSample& labelled : run.samples) {
    Sample& sample = labelled.sample;
    sample.Set(Signal::kF, 1.05 * sample[Signal::kF]);
    sample.Set(Signal::kX, sample[Signal::kX] + 1.0);
  }
  return run;
}

TEST(DifferenceObserversTest, AFurtherValveOfTheTypeTakesTheFaultsOver) {
  const std::vector<TrainingRun> healthy{FurtherValve(7, 1500)};
  // Also what a label has taught, which stands behind the others.
  ModelSet of_type = Trained();
  of_type.observers.push_back(of_type.observers.back());
  of_type.observers.back().name += kTaughtMark;
  of_type.observers.back().moved = MaskOf(Signal::kT1);
  // A set of before x1, which a set of X and F knows without an observer.
  EXPECT_EQ(std::erase(of_type.faults, kPositionTransmitterFault), 1U);
  ASSERT_TRUE(IsTransferable(of_type, healthy, TwoChannels()));

  const auto models = std::make_shared<const ModelSet>(
      TransferDifferenceSet(of_type, healthy, TwoChannels()));

  EXPECT_TRUE(Contains(models->faults, kPositionTransmitterFault));
  EXPECT_TRUE(IsTaught(models->observers.back()));
  EXPECT_EQ(models->observers.back().moved, MaskOf(Signal::kT1));
  EXPECT_EQ(ComputeIndices(ScoreRun(models, FurtherValve(4, 7200))).episodes,
            0);
  ExpectNamed(models, FurtherValve);
}

TEST(DifferenceObserversTest, OtherWorkOrChannelsAreNotServed) {
  TrainingRun elsewhere = HealthyRun(7, 1500);
  for (LabelledSample& labelled : elsewhere.samples) {
    labelled.sample.Set(Signal::kCv, labelled.sample[Signal::kCv] + 60.0);
  }
  EXPECT_FALSE(IsTransferable(Trained(), {elsewhere}, TwoChannels()));

  TrainingOptions without_flow = TwoChannels();
  without_flow.channels.pop_back();
  EXPECT_FALSE(IsTransferable(Trained(), {HealthyRun(7, 1500)}, without_flow));
}

TEST(DifferenceObserversTest, HealthyDataGiveNoEpisode) {
  const auto models = std::make_shared<const ModelSet>(Trained());
  EXPECT_EQ(ComputeIndices(ScoreRun(models, HealthyRun(4, 7200))).episodes, 0);
}

}  // namespace
}  // namespace fdi::trainer
