#include "diagnosis/observers/lone_readings.h"

#include <array>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include "tests/diagnosis/engine_run.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::kNoise;
using tests::LinearPlant;
using tests::PlantSample;
using tests::Seen;
using tests::StampOf;
using tests::StepRange;

// F follows its own measured past and P1, of which there is no channel:
// F = F(k-1)/2 + (100 - CV)/2 + (P1 - 500)/10.
ModelSet FlowWithPast() {
  ModelSet models = LinearPlant();
  for (Observer& observer : models.observers) {
    TsModel& model = observer.channels[1].model;
    model.parallel = false;
    model.regressors.push_back({Signal::kF, 1});
    model.regressors.push_back({Signal::kP1, 0});
    model.regressor_min.insert(model.regressor_min.end(), {-100.0, 0.0});
    model.regressor_max.insert(model.regressor_max.end(), {200.0, 1e4});
    TsRule& rule = model.rules.front();
    rule.antecedents.resize(3, rule.antecedents.front());
    rule.slopes = {0.5 * rule.slopes[0], 0.5, 0.1};
    rule.intercept = 0.5 * rule.intercept - 50.0;
  }
  return models;
}

Sample Resting(std::uint64_t k) {
  Sample sample = PlantSample(k, 0.0);
  sample.Set(Signal::kP1, 500.0);
  return sample;
}

class LoneReadingsTest : public testing::Test {
 protected:
  void Step(Signal signal, double change) {
    Sample sample = Resting(k_++);
    sample.values[Index(signal)] += change;
    if (k_ == 1) {
      bank_.Initialise(sample);
    }
    judged_ = lone_.Step(bank_, sample);
  }

  ModelSet models_ = FlowWithPast();
  ObserverBank bank_{models_};
  LoneReadings lone_{models_};
  std::uint64_t k_{0};
  Sample judged_;
};

TEST_F(LoneReadingsTest, OneWrongReadingStaysOutOfThePast) {
  for (const Signal signal : {Signal::kF, Signal::kP1}) {
    for (int k = 0; k < 20; ++k) {
      Step(signal, 0.0);
      EXPECT_FALSE(lone_.holds());
    }
    Step(signal, 40.0);
    EXPECT_TRUE(lone_.holds());
    EXPECT_NE(judged_.uncertain() & MaskOf(signal), 0);
    EXPECT_EQ(judged_[signal], Resting(0)[signal]);
    EXPECT_FALSE(bank_.measured(1));
    EXPECT_TRUE(bank_.measured(0)) << "of X nothing is wrong";
    EXPECT_EQ(lone_.wrong(), 0);
    // The past of F has no reading, so F abstains once more.
    Step(signal, 0.0);
    EXPECT_FALSE(lone_.holds());
    EXPECT_EQ(lone_.wrong(), MaskOf(signal));
    Step(signal, 0.0);
    EXPECT_NEAR(bank_.residual(0, 1), 0.0, 1e-9) << SignalName(signal);
  }
}

TEST_F(LoneReadingsTest, TheSecondReadingMakesAStepReal) {
  for (int k = 0; k < 20; ++k) {
    Step(Signal::kF, 0.0);
  }
  Step(Signal::kF, 40.0);
  EXPECT_NEAR(lone_.residuals()[1], 40.0, 1e-9);
  EXPECT_TRUE(std::isnan(lone_.residuals()[0]));
  Step(Signal::kF, 40.0);
  EXPECT_FALSE(lone_.holds());
  EXPECT_EQ(lone_.wrong(), 0);
  // As predicted from the reading before, which is in the past again.
  EXPECT_NEAR(bank_.residual(0, 1), 20.0, 1e-9);
}

TEST_F(LoneReadingsTest, AfterAWrongReadingTwoInARowStayOut) {
  for (const double change : {0.0, 0.0, 40.0, 0.0, 0.0, 40.0}) {
    Step(Signal::kF, change);
  }
  EXPECT_TRUE(lone_.holds());
  EXPECT_TRUE(std::isnan(lone_.residuals()[1])) << "counts no more";
  Step(Signal::kF, 40.0);
  EXPECT_TRUE(lone_.holds());
  EXPECT_NEAR(lone_.residuals()[1], 40.0, 1e-9);
  EXPECT_EQ(judged_[Signal::kF], Resting(0)[Signal::kF]);
  Step(Signal::kF, 0.0);
  EXPECT_FALSE(lone_.holds());
  Step(Signal::kF, 0.0);
  EXPECT_NEAR(bank_.residual(0, 1), 0.0, 1e-9);
}

TEST_F(LoneReadingsTest, AfterAWrongReadingTheThirdMakesAStepReal) {
  for (const double change : {0.0, 0.0, 40.0, 0.0, 0.0, 40.0, 40.0}) {
    Step(Signal::kF, change);
  }
  EXPECT_TRUE(lone_.holds());
  Step(Signal::kF, 40.0);
  EXPECT_FALSE(lone_.holds());
  EXPECT_NEAR(bank_.residual(0, 1), 20.0, 1e-9);
}

// The second reading is not known.
TEST_F(LoneReadingsTest, AReadingThatIsNotReadMakesNoStepReal) {
  Step(Signal::kF, 0.0);
  Step(Signal::kF, 40.0);
  ASSERT_TRUE(lone_.holds());
  Sample sample = Resting(k_++);
  sample.quality[Index(Signal::kF)] = SignalQuality::kUncertain;
  lone_.Step(bank_, sample);
  Step(Signal::kF, 0.0);
  Step(Signal::kF, 0.0);
  EXPECT_NEAR(bank_.residual(0, 1), 0.0, 1e-9);
}

TEST_F(LoneReadingsTest, WhatIsWrongTooOftenIsHeldOutNoLonger) {
  Step(Signal::kF, 0.0);
  int held = 0;
  for (int k = 0; k < 30; ++k) {
    Step(Signal::kF, k % 4 == 0 ? 40.0 : 0.0);
    held += lone_.holds() ? 1 : 0;
  }
  EXPECT_EQ(held, 5);
}

// The threshold of a noisy loop may be so far out that it sees no wrong
// reading.
TEST(LoneReadingsEngineTest, AWindowTakesNoLoneReading) {
  for (const double threshold : {4 * kNoise, 50.0}) {
    ModelSet models = LinearPlant();
    ChannelSpec& flow = models.channels[1];
    flow.lower_threshold = -threshold;
    flow.upper_threshold = threshold;
    flow.windows = {{10, -kNoise, kNoise, std::log(4 * kNoise)}};
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    const auto wrong = [k = 0](Sample& sample) mutable {
      sample.values[Index(Signal::kF)] += ++k % 60 == 0 ? 40.0 : 0.0;
    };
    EXPECT_TRUE(StepRange(engine, 0, 600, wrong).transitions.empty())
        << threshold;
  }
}

// A rod that goes elsewhere for a moment takes the flow along.
TEST(LoneReadingsEngineTest, WhatTwoSignalsShowIsNoLoneReading) {
  ModelSet models = LinearPlant();
  for (const std::size_t channel : {0U, 1U}) {
    models.channels[channel].lower_threshold = -50.0;
    models.channels[channel].upper_threshold = 50.0;
    models.channels[channel].windows = {
        {10, -kNoise, kNoise, std::log(4 * kNoise)}};
  }
  ValveEngine engine(std::make_shared<const ModelSet>(models));
  StepRange(engine, 0, 100);
  const Seen seen =
      StepRange(engine, 100, 103, [k = 0](Sample& sample) mutable {
        for (const Signal signal : {Signal::kX, Signal::kF}) {
          sample.values[Index(signal)] += k == 0 ? 40.0 : 0.0;
        }
        ++k;
      });
  EXPECT_FALSE(seen.transitions.empty());
}

TEST(LoneReadingsEngineTest, TheVerdictSaysOfWhichSignalAReadingWasWrong) {
  ValveEngine engine(std::make_shared<const ModelSet>(LinearPlant()));
  std::array<int, kSignalCount> single{};
  for (std::uint64_t k = 0; k < 500; ++k) {
    Sample sample = PlantSample(k, 0.0);
    if (k % 100 == 20) {
      sample.values[Index(Signal::kX)] += 40.0;
    } else if (k % 100 == 60) {
      sample.values[Index(Signal::kF)] = std::nan("");
    }
    const Verdict& verdict = engine.Step(sample);
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      single[i] += (verdict.single >> i & 1U) != 0 ? 1 : 0;
    }
  }
  std::array<int, kSignalCount> expected{};
  expected[Index(Signal::kX)] = expected[Index(Signal::kF)] = 5;
  EXPECT_EQ(single, expected);
}

// The first is alone. Later ones are two in a row, or one that is impossible
// beside one that is not.
TEST(LoneReadingsEngineTest, TwoWrongReadingsInARowOpenNoEpisode) {
  ValveEngine engine(std::make_shared<const ModelSet>(LinearPlant()));
  const Seen seen = StepRange(engine, 0, 1000, [k = 0](Sample& sample) mutable {
    ++k;
    const bool wrong = k == 100 || (k > 101 && k % 100 < 2);
    const bool impossible = k > 500 && k % 100 == 1;
    sample.values[Index(Signal::kF)] += impossible ? 1e6 : wrong ? 40.0 : 0.0;
  });
  EXPECT_TRUE(seen.transitions.empty());
  EXPECT_EQ(seen.last.quality, Quality::kLive);
  const Seen fault = StepRange(engine, 1000, 1003, tests::FullF6);
  EXPECT_EQ(fault.transitions.size(), 1U);
}

// The channel is doubted since before the restart, so two are held out.
TEST(LoneReadingsEngineTest, TheDoubtOutlastsARestart) {
  const auto models = std::make_shared<const ModelSet>(LinearPlant());
  const auto wrong = [](Sample& sample) {
    sample.values[Index(Signal::kF)] += 40.0;
  };
  ValveEngine before(models);
  StepRange(before, 0, 100);
  StepRange(before, 100, 101, wrong);
  StepRange(before, 101, 110);
  ValveEngine after(models);
  ASSERT_TRUE(after.Restore(before.Save()));
  StepRange(after, 110, 150);
  Seen seen = StepRange(after, 150, 152, wrong);
  EXPECT_TRUE(seen.transitions.empty());
  seen = StepRange(after, 152, 200);
  EXPECT_TRUE(seen.transitions.empty());
}

TEST(LoneReadingsEngineTest, AnAbruptFaultIsDetectedAtItsFirstSample) {
  ValveEngine engine(std::make_shared<const ModelSet>(LinearPlant()));
  ASSERT_TRUE(StepRange(engine, 0, 100).transitions.empty());
  EXPECT_TRUE(StepRange(engine, 100, 101, tests::FullF6).transitions.empty());
  const Seen seen = StepRange(engine, 101, 102, tests::FullF6);
  ASSERT_EQ(seen.transitions.size(), 1U);
  EXPECT_EQ(seen.transitions.front().stamp_ns, StampOf(100));
}

}  // namespace
}  // namespace fdi
