#include "diagnosis/observers/drift_watch.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/snapshot.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

// Channels, by bit.
constexpr std::uint32_t kOfX = 1;
constexpr std::uint32_t kOfF = 2;
constexpr int kBlock = 30;  // samples of half an hour

// A sample a minute.
ModelSet WatchedPlant() {
  ModelSet models = tests::LinearPlant();
  models.sample_period_s = 60.0;
  models.decision.evidence_window = 20.0;
  models.decision.interpolation_allowance = 0.04;
  models.floor.emplace();
  AddFindings(models);
  AddDriftFinding(models);
  return models;
}

ModelSet FlowByPosition() {
  ModelSet models = WatchedPlant();
  models.observers[0].channels[1].model.regressors = {{Signal::kX, 0}};
  return models;
}

// X is off by `residual`, and f1, if it has a `strength`, explains it.
Verdict OffBy(double residual, double strength = 0.0) {
  Verdict verdict;
  verdict.state = State::kDetected;
  verdict.residuals[0] = residual;
  verdict.fault_factors[0] = strength != 0.0 ? 1.0 : 0.0;
  verdict.strengths[0] = strength;
  return verdict;
}

double Growing(int k) {
  return 0.004 * k;
}
double Stepped(int k) {
  return k < 300 ? 0.0 : 1.2;
}

// The drift, if there is one, in the residuals of X until sample `end`.
std::optional<SlowDrift> Begun(const ModelSet& models,
                               const std::function<double(int)>& residual,
                               int end = 301, std::uint32_t beyond = kOfX) {
  DriftWatch watch(models);
  for (int k = 0; k < end; ++k) {
    watch.Push(OffBy(residual(k)), beyond);
  }
  watch.Begin(beyond);
  return watch.drift();
}

TEST(DriftWatchTest, WhatGrewOverHoursIsADriftWithSizeAndPace) {
  const auto drift = Begun(WatchedPlant(), Growing);
  ASSERT_TRUE(drift);
  EXPECT_NEAR(drift->now, 1.2, 0.02);
  EXPECT_NEAR(drift->slope, 0.004 * 60.0, 0.001);
  EXPECT_NEAR(drift->hours, 5.0, 0.1);
}

TEST(DriftWatchTest, WhatCameAtOnceIsNone) {
  EXPECT_FALSE(Begun(WatchedPlant(), Stepped));
  // Nor where it was seen hours later.
  EXPECT_FALSE(Begun(WatchedPlant(), Stepped, 600));
}

TEST(DriftWatchTest, WhatComesOnTopOfADriftIsNone) {
  const auto above = [](double step) {
    return [step](int k) { return Growing(k) + (k < 300 ? 0.0 : step); };
  };
  EXPECT_TRUE(Begun(WatchedPlant(), above(0.5), 325));
  EXPECT_FALSE(Begun(WatchedPlant(), above(4.0), 325));
}

TEST(DriftWatchTest, HoursOfDataAreNeeded) {
  const auto steep = [](int k) { return 0.01 * k; };
  EXPECT_FALSE(Begun(WatchedPlant(), steep, 6 * kBlock - 1));
  EXPECT_TRUE(Begun(WatchedPlant(), steep, 6 * kBlock));
}

TEST(DriftWatchTest, OfADriftOverDaysTheLongSpanTells) {
  // Half a deviation in ten days, less in one than noise hides.
  const ModelSet models = WatchedPlant();
  DriftWatch watch(models);
  tests::Noise noise(5);
  for (int k = 0; k < 10 * 1440; ++k) {
    Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
    const double before = sample[Signal::kX];
    noise.Add(sample);
    watch.Push(OffBy(2.5e-5 * k + sample[Signal::kX] - before), kOfX);
  }
  watch.Begin(kOfX);
  ASSERT_TRUE(watch.drift());
  EXPECT_NEAR(watch.drift()->now, 0.36, 0.05);
  EXPECT_NEAR(watch.drift()->hours, 240.0, 24.0);
}

TEST(DriftWatchTest, AnotherChannelIsNotX) {
  EXPECT_TRUE(Begun(FlowByPosition(), Growing));
  EXPECT_FALSE(Begun(FlowByPosition(), Growing, 301, kOfX | kOfF));
  // A flow predicted from the command moves with the rod.
  EXPECT_TRUE(Begun(WatchedPlant(), Growing, 301, kOfX | kOfF));
  EXPECT_FALSE(Begun(WatchedPlant(), Growing, 301, 0));
}

// At the end of a block, and for as long as X is off.
TEST(DriftWatchTest, WhatIsBeyondNoLimitEmerges) {
  const ModelSet models = WatchedPlant();
  DriftWatch watch(models);
  std::vector<int> emerged;
  for (int k = 0; k < 600; ++k) {
    watch.Push(OffBy(k < 420 ? 5e-4 * k : 0.0), 0);
    if (watch.Emerges()) {
      emerged.push_back(k);
      EXPECT_TRUE(watch.present());
    }
  }
  // A quarter of the deviation of 0.5 is reached after 250 samples.
  EXPECT_EQ(emerged, (std::vector<int>{269, 299, 329, 359, 389, 419}));
  EXPECT_FALSE(watch.present());
}

TEST(DriftWatchTest, AStepBelowEveryLimitDoesNotEmerge) {
  const ModelSet models = WatchedPlant();
  DriftWatch watch(models);
  for (int k = 0; k < 1000; ++k) {
    watch.Push(OffBy(k < 300 ? 0.0 : 0.2), 0);
    EXPECT_FALSE(watch.Emerges());
  }
}

TEST(DriftWatchTest, OnlySetsThatListItAreWatched) {
  ModelSet models = WatchedPlant();
  models.faults.pop_back();
  EXPECT_FALSE(Begun(models, Growing));
}

class OpenDriftTest : public testing::Test {
 protected:
  OpenDriftTest() {
    for (int k = 0; k < 301; ++k) {
      watch_.Push(OffBy(Growing(k)), kOfX);
    }
    watch_.Begin(kOfX);
    watch_.Follow(OffBy(1.2));
  }

  // @returns how many of `samples` it lasted.
  int Lasts(const Verdict& verdict, int samples, std::uint32_t beyond = kOfX) {
    for (int k = 0; k < samples; ++k) {
      watch_.Push(verdict, beyond);
      if (!watch_.drift()) {
        return k;
      }
      watch_.Follow(verdict);
    }
    return samples;
  }

  const ModelSet models_ = FlowByPosition();
  DriftWatch watch_{models_};
};

TEST_F(OpenDriftTest, ItLastsWhileOnlySmallFaultsExplainIt) {
  EXPECT_EQ(Lasts(OffBy(1.2, 0.3), 1000), 1000);
}

TEST_F(OpenDriftTest, AFaultOfMediumSizeThatStaysEndsIt) {
  // Eight memories of the evidence are needed.
  EXPECT_EQ(Lasts(OffBy(1.2, 0.4), 1000), 8 * 20 - 1);
}

TEST_F(OpenDriftTest, AFaultOfMediumSizeForAWhileDoesNot) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(Lasts(OffBy(1.2, 0.4), 15), 15) << i;
    EXPECT_EQ(Lasts(OffBy(1.2, 0.3), 15), 15) << i;
  }
}

TEST_F(OpenDriftTest, AnotherChannelThatStaysEndsIt) {
  EXPECT_EQ(Lasts(OffBy(1.2), 5, kOfX | kOfF), 5);
  EXPECT_EQ(Lasts(OffBy(1.2), 500), 500);
  EXPECT_EQ(Lasts(OffBy(1.2), 500, kOfX | kOfF), 20);
}

TEST_F(OpenDriftTest, AStepOnTopEndsIt) {
  EXPECT_LT(Lasts(OffBy(4.0), 500), 60);
}

TEST_F(OpenDriftTest, TheMemoryOutlastsARestart) {
  SnapshotWriter writer;
  watch_.Save(writer);
  const auto bytes = writer.Take();
  SnapshotReader reader(bytes);
  DriftWatch after(models_);
  ASSERT_TRUE(after.Restore(reader));
  EXPECT_TRUE(reader.AtEnd());
  after.Begin(kOfX);
  EXPECT_TRUE(after.drift());
  SnapshotReader half{std::span(bytes).first(bytes.size() / 2)};
  EXPECT_FALSE(DriftWatch(models_).Restore(half));
}

TEST(DriftValueTest, SaysSizeAndPace) {
  EXPECT_EQ(DriftValue({-0.218, -0.0409, 5.27}),
            "X reads 0.22 % below its model, growing by 0.041 % an hour for "
            "5.3 h");
  EXPECT_EQ(DriftValue({}), "");
}

// Names of the episode in turn, with X off by `off` from sample to sample.
std::vector<std::string> NamesOf(const std::function<double(int)>& off,
                                 int samples) {
  const auto models = std::make_shared<const ModelSet>(WatchedPlant());
  ValveEngine engine(models);
  tests::Noise noise(3);
  std::vector<std::string> names;
  for (int k = 0; k < samples; ++k) {
    Sample sample = tests::PlantSample(static_cast<std::uint64_t>(k));
    sample.stamp_ns = (k + 1) * 60'000'000'000LL;
    noise.Add(sample);
    sample.values[Index(Signal::kX)] -= off(k);
    for (const Transition& t : engine.Step(sample).Transitions()) {
      if (IsIsolation(t.kind)) {
        names.push_back(FaultSetName(*models, t.faults));
        EXPECT_EQ(t.drift.now < 0.0, names.back() == "x_drift");
      }
    }
  }
  return names;
}

TEST(DriftOfAValveTest, ItIsSaidUntilItIsAsLargeAsAFault) {
  const auto ramp = [](int k) { return 0.006 * k; };
  EXPECT_EQ(NamesOf(ramp, 1000), std::vector<std::string>{"x_drift"});
  EXPECT_EQ(NamesOf(ramp, 2000), (std::vector<std::string>{"x_drift", "f1"}));
}

// One episode, from before any limit is reached until X is back.
TEST(DriftOfAValveTest, ASmallOneIsAnEpisodeUntilItIsGone) {
  const auto small = [](int k) { return k < 1200 ? 5e-4 * k : 0.0; };
  EXPECT_EQ(NamesOf(small, 1800), std::vector<std::string>{"x_drift"});
}

TEST(DriftOfAValveTest, AnAbruptFaultOfThatSizeIsNamed) {
  const auto step = [](int k) { return k < 600 ? 0.0 : 5.0; };
  EXPECT_EQ(NamesOf(step, 1000), std::vector<std::string>{"f1"});
}

}  // namespace
}  // namespace fdi
