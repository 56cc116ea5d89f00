#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/decision/valve_engine.h"
#include "diagnosis/model/trained_signals.h"
#include "diagnosis/observers/intake.h"
#include "tests/diagnosis/engine_run.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

using tests::AddF6;
using tests::FullF6;
using tests::kSettled;
using tests::PlantSample;
using tests::Seen;
using tests::SharedPlant;
using tests::StepRange;

TEST(ValveEngineIntakeTest, RepeatedAndLateSamplesChangeNothing) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 60);
  ValveEngine twin(SharedPlant());
  StepRange(twin, 0, 60);
  Sample repeat = PlantSample(59);
  AddF6(repeat, 1.0);
  EXPECT_EQ(engine.Step(repeat).intake, Intake::kRepeat);
  EXPECT_EQ(engine.Step(PlantSample(10)).intake, Intake::kLate);
  const Verdict after = engine.Step(PlantSample(60));
  const Verdict expected = twin.Step(PlantSample(60));
  EXPECT_EQ(after.residuals[1], expected.residuals[1]);
  EXPECT_EQ(after.quality, Quality::kLive);
}

TEST(ValveEngineIntakeTest, GapSettlesAnewAndTakesNoDecision) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const Seen gap = StepRange(engine, 53, 54, FullF6);
  EXPECT_TRUE(gap.last.initialised);
  EXPECT_EQ(gap.last.quality, Quality::kSettling);
  const Seen settling = StepRange(engine, 54, 53 + kSettled, FullF6);
  EXPECT_TRUE(settling.transitions.empty());
  const Seen live = StepRange(engine, 53 + kSettled, 60 + kSettled, FullF6);
  ASSERT_EQ(live.transitions.size(), 1U);
}

TEST(ValveEngineIntakeTest, BadValuesNeverReachAnObserver) {
  const struct {
    double value;
    Intake intake;
  } cases[] = {{std::nan(""), Intake::kNotFinite},
               {std::numeric_limits<double>::infinity(), Intake::kNotFinite},
               {-1000.0, Intake::kRange}};
  for (const auto& bad : cases) {
    ValveEngine engine(SharedPlant());
    StepRange(engine, 0, 50);
    Sample sample = PlantSample(50);
    sample.Set(Signal::kF, bad.value);
    const Verdict verdict = engine.Step(sample);
    EXPECT_EQ(verdict.intake, bad.intake);
    EXPECT_EQ(verdict.quality, Quality::kLive);
    EXPECT_TRUE(std::isnan(verdict.residuals[1]));
    EXPECT_FALSE(engine.Step(PlantSample(51)).initialised);
  }
}

// One that is missing, too. The other channel goes on as if nothing had been.
TEST(ValveEngineIntakeTest, ASingleUnusableReadingIsBridged) {
  const auto f = Index(Signal::kF);
  const std::function<void(Sample&)> kinds[] = {
      [=](Sample& sample) { sample.values[f] = -1000.0; },
      [=](Sample& sample) { sample.quality[f] = SignalQuality::kBad; },
      [](Sample& sample) {
        sample.present =
            static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kF));
      }};
  for (const auto& spoil : kinds) {
    ValveEngine engine(SharedPlant());
    ValveEngine twin(SharedPlant());
    StepRange(engine, 0, 50);
    StepRange(twin, 0, 50);
    const Seen bad = StepRange(engine, 50, 51, spoil);
    const Seen good = StepRange(twin, 50, 51);
    EXPECT_EQ(bad.last.quality, Quality::kLive);
    EXPECT_FALSE(bad.last.initialised);
    EXPECT_EQ(bad.last.residuals[0], good.last.residuals[0]);
    EXPECT_TRUE(std::isnan(bad.last.residuals[1]));
    const Seen after = StepRange(engine, 51, 60);
    EXPECT_EQ(after.last.residuals[1],
              StepRange(twin, 51, 60).last.residuals[1]);
    EXPECT_TRUE(after.transitions.empty());
  }
}

// The place of an absent signal may hold anything.
TEST(ValveEngineIntakeTest, AnUnusableFirstReadingIsNotBridged) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50, [](Sample& sample) {
    sample.Set(Signal::kF, std::numeric_limits<double>::quiet_NaN());
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kF));
  });
  StepRange(engine, 50, 51, [](Sample& sample) {
    sample.quality[Index(Signal::kF)] = SignalQuality::kBad;
  });
  const Seen first = StepRange(engine, 51, 52);
  EXPECT_TRUE(first.last.initialised);
  EXPECT_TRUE(std::isfinite(first.last.residuals[1]));
}

TEST(ValveEngineIntakeTest, WhatIsUnusableForLongIsMissing) {
  ValveEngine engine(SharedPlant());
  StepRange(engine, 0, 50);
  const auto spoil = [](Sample& sample) { sample.Set(Signal::kF, -1000.0); };
  const int end = 50 + Bridge::kMost;
  EXPECT_EQ(StepRange(engine, 50, end, spoil).last.quality, Quality::kLive);
  EXPECT_EQ(StepRange(engine, end, end + 1, spoil).last.quality,
            Quality::kBadInput);
  EXPECT_TRUE(StepRange(engine, end + 1, end + 2).last.initialised);
}

TEST(ValveEngineIntakeTest, BadQualityIsRefused) {
  ValveEngine engine(SharedPlant());
  Sample sample = PlantSample(0);
  sample.quality[Index(Signal::kF)] = SignalQuality::kBad;
  EXPECT_EQ(engine.Step(sample).intake, Intake::kBadQuality);
}

// The plant without X; at its position, of which the command says nothing.
std::shared_ptr<const ModelSet> FlowOfThePlant(bool position_as_command) {
  ModelSet models = tests::LinearPlant();
  models.channels.erase(models.channels.begin());
  for (Observer& observer : models.observers) {
    observer.channels.erase(observer.channels.begin());
  }
  models.position_as_command = position_as_command;
  Validate(models);
  return std::make_shared<const ModelSet>(std::move(models));
}

void LoseCommand(Sample& sample) {
  sample.Set(Signal::kCv,
             50.0 + 40.0 * std::sin(1.7 * static_cast<double>(sample.seq)));
}

TEST(ValveEngineIntakeTest, ASetMayReadThePositionAsCommand) {
  ValveEngine engine(FlowOfThePlant(true));
  ValveEngine twin(FlowOfThePlant(false));
  const Seen healthy = StepRange(engine, 0, 100, LoseCommand);
  EXPECT_EQ(healthy.last.quality, Quality::kLive);
  EXPECT_TRUE(healthy.transitions.empty());
  StepRange(twin, 0, 100);
  const Seen faulty = StepRange(engine, 100, 150, [](Sample& sample) {
    LoseCommand(sample);
    AddF6(sample, 1.0);
  });
  const Seen same = StepRange(twin, 100, 150, FullF6);
  ASSERT_EQ(faulty.transitions.size(), same.transitions.size());
  ASSERT_FALSE(faulty.transitions.empty());
  EXPECT_EQ(faulty.last.residuals[0], same.last.residuals[0]);
  EXPECT_EQ(faulty.last.isolated, same.last.isolated);
}

TEST(ValveEngineIntakeTest, ThePositionAsCommandIsCheckedLikeACommand) {
  const auto models = FlowOfThePlant(true);
  EXPECT_EQ(RequiredSignals(*models), MaskOf(Signal::kX) | MaskOf(Signal::kF));
  const auto judge = [&](const auto& change) {
    ValveEngine engine(models);
    StepRange(engine, 0, 50, LoseCommand);
    Sample sample = PlantSample(50);
    change(sample);
    return engine.Step(sample);
  };
  const auto x = Index(Signal::kX);
  EXPECT_EQ(judge([](Sample&) {}).quality, Quality::kLive);
  EXPECT_EQ(
      judge([&](Sample& s) { s.quality[x] = SignalQuality::kBad; }).intake,
      Intake::kBadQuality);
  EXPECT_EQ(judge([&](Sample& s) { s.values[x] = std::nan(""); }).intake,
            Intake::kNotFinite);
  // The command neither counts where it is bad nor stands in where X is not: it
  // is bridged.
  EXPECT_EQ(judge([](Sample& s) {
              s.quality[Index(Signal::kCv)] = SignalQuality::kBad;
            }).quality,
            Quality::kLive);
  EXPECT_TRUE(std::isnan(
      judge([](Sample& s) { s.present ^= MaskOf(Signal::kX); }).residuals[0]));
}

TEST(ValveEngineIntakeTest, PositionAsCommandLeavesTheOtherReadings) {
  Sample sample = PlantSample(3);
  sample.Set(Signal::kCv, 12.0);
  sample.Set(Signal::kX, 34.0);
  sample.quality[Index(Signal::kX)] = SignalQuality::kUncertain;
  const Sample seen = PositionAsCommand(sample);
  EXPECT_EQ(seen[Signal::kCv], 34.0);
  EXPECT_EQ(seen.present, MaskOf(Signal::kCv) | MaskOf(Signal::kF));
  EXPECT_EQ(seen.uncertain(), MaskOf(Signal::kCv));
  EXPECT_EQ(seen[Signal::kF], sample[Signal::kF]);
  EXPECT_EQ(seen.stamp_ns, sample.stamp_ns);
}

TEST(ValveEngineIntakeTest, AnotherFlowUnitIsRefused) {
  ValveEngine engine(SharedPlant());
  Sample sample = PlantSample(0);
  sample.flow_unit = FlowUnit::kTPerHour;
  EXPECT_EQ(engine.Step(sample).intake, Intake::kUnit);
}

// P1 is 3500 kPa, from 3200 to 3800 in normal operation.
std::shared_ptr<const ModelSet> PressurePlant() {
  ModelSet models = tests::LinearPlant();
  models.channels.push_back({"P1", Signal::kP1, -50.0, 50.0});
  for (Observer& observer : models.observers) {
    observer.channels.push_back(tests::LinearModel(Signal::kP1, 0.0, 3500.0));
    observer.channels.back().model.output_max = 4000.0;
  }
  models.validity.p1 = {3200.0, 3800.0};
  return std::make_shared<const ModelSet>(models);
}

// Bar for kPa, or a decimal point elsewhere, is no fault of the valve. Any
// other reading may be one.
TEST(ValveEngineIntakeTest, APressureInAnotherUnitIsRefused) {
  const struct {
    double p1;
    Intake intake;
  } cases[] = {{3500.0, Intake::kAccepted}, {35.0, Intake::kUnit},
               {350.0, Intake::kUnit},      {3.5, Intake::kUnit},
               {0.0, Intake::kAccepted},    {2000.0, Intake::kAccepted},
               {700.0, Intake::kAccepted}};
  for (const auto& read : cases) {
    ValveEngine engine(PressurePlant());
    const Seen seen = StepRange(engine, 0, 100, [&](Sample& sample) {
      sample.Set(Signal::kP1, sample.seq < 50 ? 3500.0 : read.p1);
    });
    EXPECT_EQ(seen.last.intake, read.intake) << read.p1;
    EXPECT_EQ(seen.transitions.empty(),
              read.intake == Intake::kUnit || read.p1 == 3500.0)
        << read.p1;
  }
}

// A pump that stops leaves a tenth of the pressure for once, and no flow.
TEST(ValveEngineIntakeTest, APressureThatFallsWithTheFlowIsNoOtherUnit) {
  for (const bool flows : {true, false}) {
    ValveEngine engine(PressurePlant());
    const Seen seen = StepRange(engine, 0, 100, [&](Sample& sample) {
      sample.Set(Signal::kP1, sample.seq < 50 ? 3500.0 : 350.0);
      if (sample.seq >= 50 && !flows) {
        sample.Set(Signal::kF, 0.0);
      }
    });
    EXPECT_EQ(seen.last.intake, flows ? Intake::kUnit : Intake::kAccepted);
    EXPECT_EQ(seen.last.detected, !flows);
  }
}

// A pressure that falls passes a tenth of the usual one: no reason to stop.
TEST(ValveEngineIntakeTest, InAnEpisodeAPressureIsJudgedAsItIs) {
  ValveEngine engine(PressurePlant());
  const Seen seen = StepRange(engine, 0, 100, [&](Sample& sample) {
    sample.Set(Signal::kP1, sample.seq < 50   ? 3500.0
                            : sample.seq < 70 ? 2000.0
                                              : 350.0);
  });
  EXPECT_EQ(seen.last.intake, Intake::kAccepted);
  EXPECT_TRUE(seen.last.detected);
}

// T1 in kelvin; but a medium may get as hot.
TEST(ValveEngineIntakeTest, ATemperatureInKelvinIsRefusedWhereAStreamBegins) {
  ModelSet models = tests::LinearPlant();
  models.channels.push_back({"T1", Signal::kT1, -5.0, 5.0});
  for (Observer& observer : models.observers) {
    observer.channels.push_back(tests::LinearModel(Signal::kT1, 0.0, 20.0));
  }
  models.validity.t1 = {15.0, 25.0};
  for (const std::uint64_t from : {0U, 50U}) {
    ValveEngine engine(std::make_shared<const ModelSet>(models));
    const Seen seen = StepRange(engine, 0, 100, [&](Sample& sample) {
      sample.Set(Signal::kT1, sample.seq < from ? 20.0 : 293.0);
    });
    EXPECT_EQ(seen.last.intake, from == 0 ? Intake::kUnit : Intake::kAccepted);
    EXPECT_EQ(seen.last.detected, from != 0);
  }
}

TEST(ValveEngineIntakeTest, ChannelWithoutItsSignalAbstains) {
  ValveEngine engine(SharedPlant());
  const auto without_flow = [](Sample& s) {
    s.present = static_cast<SignalMask>(s.present & ~MaskOf(Signal::kF));
  };
  StepRange(engine, 0, 50, without_flow);
  const Seen seen = StepRange(engine, 50, 80, [&](Sample& s) {
    without_flow(s);
    s.values[Index(Signal::kX)] -= 20.0;
  });
  EXPECT_EQ(seen.last.confidence, 0.5);
  EXPECT_TRUE(std::isnan(seen.last.residuals[1]));
  EXPECT_EQ(FaultSetName(engine.models(), seen.last.isolated), "f1");
}

TEST(ValveEngineIntakeTest, WhereEveryFaultLooksNormalNothingIsJudged) {
  ModelSet models = *SharedPlant();
  models.undetectable = {models.faults.begin() + 1, models.faults.end()};
  ValveEngine seeing(std::make_shared<const ModelSet>(models));
  EXPECT_EQ(StepRange(seeing, 0, 50).last.confidence, 1.0);

  models.undetectable = models.faults;
  ValveEngine blind(std::make_shared<const ModelSet>(models));
  EXPECT_EQ(StepRange(blind, 0, 50).last.confidence, 0.0);

  // One that no observer is taught makes no set that sees.
  models.faults.push_back(kPositionTransmitterFault);
  ValveEngine still(std::make_shared<const ModelSet>(models));
  EXPECT_EQ(StepRange(still, 0, 50).last.confidence, 0.0);
}

}  // namespace
}  // namespace fdi
