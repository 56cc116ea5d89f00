#include "simulator/second_look/second_look.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/decision/look_answer.h"
#include "diagnosis/decision/valve_looks.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/growth.h"
#include "simulator/fault_effects.h"
#include "simulator/record_fit.h"
#include "tests/simulator/recorded_valve.h"

namespace fdi::simulator {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

class NamedFaultTest : public ::testing::TestWithParam<std::pair<int, double>> {
};

TEST_P(NamedFaultTest, ComesFirstWithItsStrengthInTheInterval) {
  const auto [fault, strength] = GetParam();
  const SecondLook look =
      RunSecondLook(Physics(), Window({Abrupt(fault, strength)}));
  const Explanation& best = look.ranked.front();
  EXPECT_EQ(best.fault, fault);
  EXPECT_NEAR(best.strength, strength, 0.05);
  EXPECT_LE(best.lowest, strength + 0.02);
  EXPECT_GE(best.highest, strength - 0.02);
  EXPECT_LT(look.misfit, 1.5);
  EXPECT_EQ(AnswerOf(look).outcome, LookOutcome::kNamed);
}

INSTANTIATE_TEST_SUITE_P(
    SecondLook, NamedFaultTest,
    ::testing::Values(std::pair{1, 0.45}, std::pair{1, 0.25},
                      std::pair{13, -0.2}, std::pair{16, 0.7},
                      std::pair{16, 0.78}, std::pair{19, 0.25},
                      std::pair{kPositionTransmitterFault, 0.06},
                      std::pair{kPositionTransmitterFault, -0.2},
                      std::pair{13, 0.06}));

// A fault that has stood since before the window.
LookWindow OnTopOf(const Explanation& standing,
                   std::vector<FaultSchedule> faults) {
  FaultSchedule first = Abrupt(standing.fault, standing.strength);
  first.start_s = 0.0;
  faults.push_back(first);
  LookWindow window = Window(faults);
  window.standing = standing.fault;
  window.standing_strength = standing.strength;
  return window;
}

class OnTopTest
    : public ::testing::TestWithParam<std::pair<Explanation, Explanation>> {};

TEST_P(OnTopTest, IsNamedWithItsStrength) {
  const auto& [standing, second] = GetParam();
  const SecondLook look = RunSecondLook(
      Physics(), OnTopOf(standing, {Abrupt(second.fault, second.strength)}));
  const Explanation& best = look.ranked.front();
  EXPECT_EQ(best.fault, second.fault);
  EXPECT_NEAR(best.strength, second.strength, 0.05);
  EXPECT_LT(look.misfit, 1.5);
  EXPECT_EQ(AnswerOf(look).outcome, LookOutcome::kNamed);
  EXPECT_EQ(
      std::ranges::count(look.ranked, standing.fault, &Explanation::fault), 0);
}

INSTANTIATE_TEST_SUITE_P(
    SecondLook, OnTopTest,
    ::testing::Values(std::pair{Explanation{13, 0.2}, Explanation{1, 0.5}},
                      std::pair{Explanation{1, 0.4}, Explanation{19, -0.3}}));

// Faults of the rod, of readings, and of an input that is read wrong.
TEST(SecondLookTest, AStandingFaultByItselfIsWhatIsExpected) {
  for (const Explanation& standing :
       {Explanation{1, 0.4}, Explanation{13, 0.2}, Explanation{19, -0.3},
        Explanation{22, 0.1}}) {
    LookWindow window = OnTopOf(standing, {});
    EXPECT_LT(MisfitWithoutFault(Physics(), window), 1.5) << standing.fault;
    window.standing = 0;
    EXPECT_GT(MisfitWithoutFault(Physics(), window), 3.0) << standing.fault;
  }
}

TEST(SecondLookTest, FindsAGrowingFault) {
  FaultSchedule growing = Abrupt(13, 0.4);
  growing.start_s = 60.0;
  growing.development_s = 260.0;
  const SecondLook look = RunSecondLook(Physics(), Window({growing}));
  EXPECT_EQ(look.ranked.front().fault, 13);
  EXPECT_TRUE(look.ranked.front().growing);
  EXPECT_NEAR(look.ranked.front().strength, 0.4, 0.05);
}

// The range of a valve in another size than its type is a guess.
TEST(SecondLookTest, FindsWhereTheFlowTransmitterEnds) {
  ValvePhysics physics = Physics();
  physics.parameters.instruments.flow.high = 43.0;
  const SecondLook look = RunSecondLook(physics, Window({Abrupt(1, 0.7)}));
  EXPECT_EQ(look.ranked.front().fault, 1);
  EXPECT_NEAR(look.ranked.front().strength, 0.7, 0.05);
  EXPECT_LT(look.misfit, 1.5);
}

TEST(SecondLookTest, FindsNothingInAHealthyWindow) {
  EXPECT_EQ(AnswerOf(RunSecondLook(Physics(), Window({}))).outcome,
            LookOutcome::kNothing);
}

TEST(SecondLookTest, MisfitDoesNotGrowWithTheEffectOfAFault) {
  const SecondLook look = RunSecondLook(Physics(), Window({Abrupt(10, 0.85)}));
  EXPECT_EQ(look.ranked.front().fault, 10);
  EXPECT_LT(look.misfit, 1.2);
}

// The supply pressure, which a healthy record leaves open, decides between the
// two: f10 gains by another one, here not enough.
TEST(SecondLookTest, ComparesASupplyDropWithPerforationAtAnotherSupply) {
  const SecondLook look = RunSecondLook(Physics(), Window({Abrupt(16, 0.7)}));
  const auto f10 = std::ranges::find(look.ranked, 10, &Explanation::fault);
  ASSERT_TRUE(look.perforation);
  EXPECT_EQ(look.perforation->fault, 10);
  EXPECT_LT(look.perforation->distance, f10->distance);
  EXPECT_GT(look.perforation->distance, kLookMargin);
  EXPECT_FALSE(
      RunSecondLook(Physics(), Window({Abrupt(13, -0.2)})).perforation);
}

// Judged at its position, a valve has no fault whose only sign is the way
// there: neither f1, of which X shows the stop, nor f10 and f16.
TEST(SecondLookTest, AtThePositionOnlyWhatActsBehindItExplains) {
  LookWindow window = Window({Abrupt(18, 0.5)});
  for (RecordRow& row : window.rows) {
    row.input.cv_pct = row.x_pct;
    row.x_measured = false;
  }
  window.signals &= static_cast<SignalMask>(~MaskOf(Signal::kX));
  window.at_position = true;
  const SecondLook look = RunSecondLook(Physics(), window);
  EXPECT_TRUE(look.complete);
  const LookAnswer answer = AnswerOf(look);
  EXPECT_EQ(answer.outcome, LookOutcome::kNamed);
  EXPECT_TRUE(std::ranges::any_of(
      answer.faults, [](const Explanation& e) { return e.fault == 18; }));
  for (const Explanation& e : look.ranked) {
    EXPECT_TRUE(e.fault == 0 || IsFinding(e.fault) || !ShowsInRodAlone(e.fault))
        << FaultName(e.fault);
  }
}

// A fault that grows by a quarter in eight hours, as windows of seven minutes
// see it each hour or two, which tell when it will be full.
class GrowingFaultTest
    : public ::testing::TestWithParam<std::pair<int, double>> {};

TEST_P(GrowingFaultTest, HasItsStrengthsAndTheTimeToFullInTheirIntervals) {
  const auto [fault, sign] = GetParam();
  std::vector<StrengthPoint> points;
  Explanation known;
  known.fault = fault;
  known.strength = sign * 0.3;
  for (const double hour : {0.0, 1.0, 2.0, 4.0, 6.0, 8.0}) {
    constexpr double kRows = 420.0;
    const double strength = 0.25 + 0.25 * hour / 8.0;
    FaultSchedule growing = Abrupt(fault, 0.0);
    growing.start_s = 0.0;
    growing.initial_strength = sign * strength;
    growing.final_strength = sign * (strength + 0.25 * kRows / 28'800.0);
    growing.development_s = kRows;
    LookWindow window{
        Recording(static_cast<std::size_t>(kRows),
                  static_cast<std::uint64_t>(11 + hour), {growing}),
        0, kBasicSignals};
    const StrengthLook look = EstimateStrengths(Physics(), window, {known});
    ASSERT_EQ(look.faults.size(), 1U);
    known = look.faults[0];
    EXPECT_EQ(known.fault, fault);
    EXPECT_LT(look.misfit, 1.5);
    const double truth = sign * (strength + 0.125 * kRows / 28'800.0);
    EXPECT_NEAR(known.strength, truth, 0.02) << hour;
    EXPECT_LE(known.lowest, truth + 0.002) << hour;
    EXPECT_GE(known.highest, truth - 0.002) << hour;
    EXPECT_LT(known.highest - known.lowest, 0.05) << hour;
    StrengthPoint& p = points.emplace_back();
    p.stamp_ns = static_cast<std::int64_t>(hour * 3600.0) * kSecond;
    p.fault = fault;
    p.strength = known.strength;
    p.lowest = known.lowest;
    p.highest = known.highest;
  }
  const auto growth = GrowthOf(points, fault);
  ASSERT_TRUE(growth && growth->rate && growth->full);
  EXPECT_LT(growth->rate->lowest, 0.75);
  EXPECT_GT(growth->rate->highest, 0.75);
  EXPECT_LT(growth->full->lowest, 57'600.0);
  EXPECT_GT(growth->full->highest, 57'600.0);
  EXPECT_LT(growth->full->highest - growth->full->lowest, 57'600.0);
}

INSTANTIATE_TEST_SUITE_P(SecondLook, GrowingFaultTest,
                         ::testing::Values(std::pair{3, 1.0}, std::pair{2, 1.0},
                                           std::pair{13, -1.0},
                                           std::pair{19, -1.0}));

TEST(SecondLookTest, EndsWithoutAnAnswerIfItIsAskedToStop) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(
      RunSecondLook(Physics(), Window({}), stop.get_token()).ranked.empty());
  EXPECT_TRUE(
      EstimateStrengths(Physics(), Window({}), {{19, 0.5}}, stop.get_token())
          .faults.empty());
}

TEST(SecondLookTest, TakesAConstantShiftOfXForDrift) {
  LookWindow window = Window({});
  for (RecordRow& row : window.rows) {
    row.x_pct += 1.0;
  }
  EXPECT_EQ(AnswerOf(RunSecondLook(Physics(), window)).outcome,
            LookOutcome::kNothing);
}

// Every reading is off by the healthy deviation, to either side in turn. The
// misfit is that of one reading, however many there are.
TEST(SecondLookTest, MisfitDoesNotDependOnTheLengthOfTheWindow) {
  for (const std::size_t count : {20U, 400U}) {
    std::vector<RecordRow> rows(count, {{60.0, 3555.0, 2615.0, 100.7}, 0, 0});
    const auto answers =
        SimulateRecord(Physics().parameters, rows, 0, count, Physics().drive);
    for (std::size_t k = 0; k < count; ++k) {
      const double sign = k % 2 == 0 ? 1.0 : -1.0;
      rows[k].x_pct = answers[k].x_pct + sign * Physics().x.sd;
      rows[k].flow = answers[k].flow + sign * Physics().flow.sd;
    }
    for (const std::size_t detection : {0U, 4U, 8U}) {
      EXPECT_NEAR(
          MisfitWithoutFault(Physics(), {rows, detection, kBasicSignals}),
          6.0 * std::log1p(1.0 / 6.0), 0.01)
          << count << ' ' << detection;
    }
  }
}

TEST(SecondLookTest, WhatIsNotMeasuredSaysNothing) {
  for (const bool marked : {false, true}) {
    LookWindow window = Window({Abrupt(19, 0.25)});
    for (std::size_t k = 0; k < window.rows.size(); k += k % 3 + 1) {
      RecordRow& row = window.rows[k];
      row.x_pct += 15.0;
      row.flow *= 1.5;
      row.x_measured = row.flow_measured = !marked;
    }
    const SecondLook look = RunSecondLook(Physics(), window);
    const Explanation& best = look.ranked.front();
    EXPECT_EQ(best.fault == 19 && std::abs(best.strength - 0.25) < 0.05,
              marked);
  }
}

// A travel stop is first sought where X was seen to end. X is lost for the last
// 20 of 200 rows: what stands in its place must not change the answer.
TEST(SecondLookTest, ATravelStopIsSoughtInReadingsAlone) {
  const auto look = [](double held_pct) {
    LookWindow window = Window({Abrupt(1, 0.47)});
    for (RecordRow& row : std::span(window.rows).last(20)) {
      row.x_pct = held_pct;
      row.x_measured = false;
    }
    const SecondLook result = RunSecondLook(Physics(), window);
    return *std::ranges::find(result.ranked, 1, &Explanation::fault);
  };
  const Explanation low = look(0.0);
  const Explanation high = look(97.0);
  EXPECT_EQ(low.strength, high.strength);
  EXPECT_EQ(low.distance, high.distance);
}

// The command opens by 25 %, which a rod at a stop would follow, and closes. A
// play as wide as the travel would let the rod go at one of its edges.
TEST(SecondLookTest, ARodThatRestsIsFrictionWhereverItRests) {
  for (const double rest : {48.0, 60.0, 74.0}) {
    LookWindow window = Window({});
    for (std::size_t k = kLeadIn; k < window.rows.size(); ++k) {
      RecordRow& row = window.rows[k];
      row.input.cv_pct = rest + (k < kLeadIn + 100 ? -25.0 : 25.0);
      row.x_pct = rest + 0.2 * (static_cast<double>(k % 5) - 2.0);
      row.flow = FlowReading(Physics().parameters, {}, row.input, rest) +
                 0.05 * (static_cast<double>(k % 7) - 3.0);
    }
    const SecondLook look = RunSecondLook(Physics(), window);
    EXPECT_EQ(look.ranked.front().fault, kStemFriction) << rest;
    EXPECT_EQ(look.ranked.front().strength, 1.0) << rest;
    EXPECT_GT(look.ranked[1].distance, kLookMargin) << rest;
    EXPECT_LT(look.misfit, 2.0) << rest;
  }
}

// Without the pressures, one that changed is seen in the flow alone.
TEST(SecondLookTest, APressureThatIsNotMeasuredMayHaveChanged) {
  LookWindow window = Window({Abrupt(17, 0.4)});
  for (RecordRow& row : window.rows) {
    row.input.p1_kpa = Physics().p1.mean;
    row.input.p2_kpa = Physics().p2.mean;
    row.input.t1_degc = Physics().t1.mean;
  }
  window.signals = static_cast<SignalMask>(
      MaskOf(Signal::kCv) | MaskOf(Signal::kX) | MaskOf(Signal::kF));
  const SecondLook look = RunSecondLook(Physics(), window);
  EXPECT_FALSE(look.complete);
  const auto f17 = std::ranges::find(look.ranked, 17, &Explanation::fault);
  ASSERT_NE(f17, look.ranked.end());
  EXPECT_LE(f17->distance, kLookMargin);
  EXPECT_NEAR(f17->strength, 0.4, 0.1);
  const LookAnswer answer = AnswerOf(look);
  EXPECT_NE(std::ranges::find(answer.faults, 17, &Explanation::fault),
            answer.faults.end());
}

TEST(SecondLookTest, ManagesWithoutAPosition) {
  LookWindow window = Window({Abrupt(19, 0.4)});
  for (RecordRow& row : window.rows) {
    row.x_pct = 0.0;
    row.x_measured = false;
  }
  window.signals = static_cast<SignalMask>(kBasicSignals & ~MaskOf(Signal::kX));
  const SecondLook look = RunSecondLook(Physics(), window);
  const auto f19 = std::ranges::find(look.ranked, 19, &Explanation::fault);
  EXPECT_LE(f19->distance, kLookMargin);
  EXPECT_NEAR(f19->strength, 0.4, 0.05);
}

// A flow that wanders in slow data does so for longer than a look: all of its
// rows are one reading, not a part of one.
TEST(SecondLookTest, AWindowWithinTheCorrelationIsOneReading) {
  ValvePhysics physics = Physics();
  physics.flow.correlation_time = 1000.0;
  LookWindow window = Window({Abrupt(19, 0.4)});
  const auto first = window.rows.begin() + kLeadIn;
  window.rows = {first, first + 40};
  window.detection = 0;
  window.signals = MaskOf(Signal::kCv) | MaskOf(Signal::kF);
  for (RecordRow& row : window.rows) {
    row.x_measured = false;
  }
  const SecondLook look = RunSecondLook(physics, window);
  EXPECT_NEAR(look.readings, 1.0, 1e-9);
  EXPECT_NE(look.ranked.front().fault, 0);
  EXPECT_LT(look.misfit, 1.5);
}

// A row of a minute ends within three quarters of a per cent of where one of
// ten seconds does: the rest is what has not settled by then.
TEST(RecordFitTest, LongRowsAreSimulatedForAsLongAsAValveSettles) {
  EXPECT_EQ(SimulatedPeriod(1.0, {}), 1.0);
  EXPECT_EQ(SimulatedPeriod(60.0, {}), 10.0);
  const std::vector<RecordRow> record = Recording(60, 2, {});
  const auto answers = [&](double period_s) {
    ValveSimulationConfig config;
    RecordedExcitation excitation;
    for (const RecordRow& row : record) {
      excitation.rows.push_back(row.input);
    }
    config.excitation = std::move(excitation);
    config.period_s = period_s;
    config.duration_s = 60.0 * period_s;
    config.noise = config.resolution = false;
    ValveSimulation simulation(config);
    std::vector<double> x;
    while (!simulation.finished()) {
      x.push_back(simulation.Step().sample[Signal::kX]);
    }
    return x;
  };
  const std::vector<double> whole = answers(60.0);
  const auto shorter = SimulateRecord(ParameterSet("lublin-actuator-3"), record,
                                      0, record.size(), {60.0});
  for (std::size_t k = 0; k < whole.size(); ++k) {
    EXPECT_NEAR(shorter[k].x_pct, whole[k], 0.75) << k;
  }
}

TEST(FlowTargetTest, IsTheMediumOfThePhysics) {
  ModelSet models;
  models.flow_unit = FlowUnit::kTPerHour;
  EXPECT_EQ(FlowTargetOf(models).medium, Medium{});
  ValvePhysics physics = Physics();
  physics.parameters.medium.fluid = Fluid::kSteam;
  physics.p1.mean = 1000.0;
  physics.t1.mean = 190.0;
  models.physics = ToValues(physics);
  const FlowTarget target = FlowTargetOf(models);
  EXPECT_EQ(target.unit, FlowUnit::kTPerHour);
  EXPECT_TRUE(target.medium.is_gas());
  EXPECT_EQ(target.p1_kpa, 1000.0);
  EXPECT_EQ(target.t1_degc, 190.0);
}

TEST(SecondLookTest, GivesTheSameBitsTwice) {
  const LookWindow window = Window({Abrupt(10, 0.5)});
  const SecondLook one = RunSecondLook(Physics(), window);
  const SecondLook two = RunSecondLook(Physics(), window);
  ASSERT_EQ(one.ranked.size(), two.ranked.size());
  for (std::size_t i = 0; i < one.ranked.size(); ++i) {
    EXPECT_EQ(one.ranked[i].fault, two.ranked[i].fault);
    EXPECT_EQ(one.ranked[i].distance, two.ranked[i].distance);
  }
}

TEST(ValvePhysicsTest, IsReadBackAsItWasStored) {
  ValvePhysics physics = Physics();
  physics.drive.command_delay = -1;  // The command is stamped after it acted.
  const std::vector<PhysicalValue> values = ToValues(physics);
  const std::vector<PhysicalValue> again = ToValues(PhysicsFrom(values));
  ASSERT_EQ(values.size(), again.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(values[i].name, again[i].name);
    EXPECT_EQ(values[i].value, again[i].value);
  }
}

TEST(ValvePhysicsTest, RefusesAValueThatIsMissingOrUnknown) {
  std::vector<PhysicalValue> values = ToValues(Physics());
  values.push_back({"loop.unheard_of", 1.0});
  EXPECT_THROW(PhysicsFrom(values), DataError);
  values.pop_back();
  values.erase(values.end() - 4);
  EXPECT_THROW(PhysicsFrom(values), DataError);
}

TEST(ValvePhysicsTest, AMissingValueThatWasAlwaysThereIsRefused) {
  for (const char* name :
       {"parameters.actuator.spring_rate_n_m", "parameters.trim.exponent"}) {
    std::vector<PhysicalValue> values = ToValues(Physics());
    ASSERT_EQ(std::erase_if(values,
                            [name](const PhysicalValue& value) {
                              return value.name == name;
                            }),
              1U);
    EXPECT_THROW(PhysicsFrom(values), DataError) << name;
  }
}

// A double that no enumeration has would be undefined behaviour.
TEST(ValvePhysicsTest, RefusesNumbersThatNoEnumerationHas) {
  for (const char* name :
       {"parameters.actuator.spring", "parameters.medium.fluid",
        "parameters.positioner.relay", "loop.reads_flow"}) {
    for (const double bad : {-1.0, 0.5, 17.0, 1e300, std::nan("")}) {
      std::vector<PhysicalValue> values = ToValues(Physics());
      int found = 0;
      for (PhysicalValue& value : values) {
        if (value.name == name) {
          value.value = bad;
          ++found;
        }
      }
      ASSERT_EQ(found, 1) << name;
      EXPECT_THROW(PhysicsFrom(values), DataError) << name << bad;
    }
  }
}

TEST(ValvePhysicsTest, TablesAndMediaAreReadBack) {
  ValvePhysics physics = Physics();
  physics.parameters.trim.characteristic = FlowCharacteristic::kTable;
  physics.parameters.trim.table_h = {0.3, 0.6, 1.0};
  physics.parameters.trim.table_f = {0.1, 0.4, 1.0};
  physics.parameters.medium.fluid = Fluid::kSteam;
  const ValveParameters again = PhysicsFrom(ToValues(physics)).parameters;
  EXPECT_EQ(again.trim.table_h, physics.parameters.trim.table_h);
  EXPECT_EQ(again.trim.table_f, physics.parameters.trim.table_f);
  EXPECT_EQ(again.medium.fluid, Fluid::kSteam);
}

TEST(ValvePhysicsTest, FilledInReadingsDoNotCountInTheScatter) {
  std::vector<RecordRow> rows = Recording(1200, 1, {});
  for (std::size_t k = 0; k < rows.size(); k += k % 3 + 1) {
    RecordRow& row = rows[k];
    row.x_pct += 15.0;
    row.flow *= 1.5;
    row.x_measured = row.flow_measured = false;
  }
  const ValvePhysics physics =
      DescribeValve(ParameterSet("lublin-actuator-3"), {}, {rows});
  EXPECT_NEAR(physics.x.sd, Physics().x.sd, 0.1 * Physics().x.sd);
  EXPECT_NEAR(physics.flow.sd, Physics().flow.sd, 0.1 * Physics().flow.sd);
  // In rows, not in readings.
  EXPECT_NEAR(physics.x.correlation_time, Physics().x.correlation_time,
              0.5 * Physics().x.correlation_time);
}

// If a controller reads F, its noise moves the command in the next row.
// The record has every `hold`-th reading of F.
LoopHabit HabitOf(double gain, int hold = 1) {
  NormalSource noise(5, 1);
  RecordedExcitation excitation;
  std::vector<double> in_flow;
  for (int k = 0; k < 3000; ++k) {
    const double feedback = k == 0 ? 0.0 : gain * in_flow.back();
    excitation.rows.push_back(
        {60.0 + 6.0 * std::sin(0.02 * k) + 0.4 * noise() - feedback, 3555.0,
         2615.0, 100.7});
    in_flow.push_back(0.3 * noise());
  }
  ValveSimulationConfig config;
  config.excitation = std::move(excitation);
  config.duration_s = 3000.0;
  ValveSimulation simulation(config);
  std::vector<RecordRow> rows;
  for (int k = 0; k < 3000; ++k) {
    const Sample s = simulation.Step().sample;
    rows.push_back(
        {{s[Signal::kCv], s[Signal::kP1], s[Signal::kP2], s[Signal::kT1]},
         s[Signal::kX],
         s[Signal::kF] + in_flow[static_cast<std::size_t>(k)]});
    if (k % hold != 0) {
      rows.back().flow = rows[rows.size() - 2].flow;
      rows.back().flow_measured = false;
    }
  }
  return DescribeValve(ParameterSet("lublin-actuator-3"), {}, {rows}).loop;
}

TEST(ValvePhysicsTest, SeesAControllerThatReadsTheFlow) {
  EXPECT_FALSE(HabitOf(0.0).reads_flow);
  EXPECT_TRUE(HabitOf(1.0).reads_flow);
  EXPECT_TRUE(HabitOf(0.2).reads_flow);
  EXPECT_GT(HabitOf(0.0).command_sd, 1.0);
  EXPECT_TRUE(Physics().loop.reads_flow);  // Too few rows to know better.
}

// Too few readings do not tell, however many rows are filled in.
TEST(ValvePhysicsTest, DoesNotMissItBetweenFilledInReadingsOfTheFlow) {
  EXPECT_TRUE(HabitOf(1.0, 5).reads_flow);
}

TEST(SecondLookTest, ACommandThatMovedTellsAgainstTheFlowTransmitter) {
  const LookWindow window = Window({Abrupt(2, 0.5)}, 2, -12.0);
  // Distance of f19 behind f2.
  const auto behind = [&window](const LoopHabit& loop) {
    ValvePhysics physics = Physics();
    physics.loop = loop;
    const SecondLook look = RunSecondLook(physics, window);
    const auto distance = [&look](int fault) {
      return std::ranges::find(look.ranked, fault, &Explanation::fault)
          ->distance;
    };
    return distance(19) - distance(2);
  };
  const double unknown = behind({2.5, true});
  EXPECT_GT(behind({2.5, false}), unknown + kLookMargin);
  EXPECT_EQ(behind({0.0, false}), unknown);
}

SecondLook Looked(std::vector<std::pair<int, double>> distances,
                  double misfit = 1.0) {
  SecondLook look;
  look.misfit = misfit;
  for (const auto& [fault, distance] : distances) {
    Explanation explanation;
    explanation.fault = fault;
    explanation.distance = distance;
    look.ranked.push_back(explanation);
  }
  return look;
}

TEST(LookAnswerTest, KeepsLeakAndBypassTogetherUnlessTheLeakIsTooLarge) {
  SecondLook look = Looked({{18, 0.0}, {6, 5.0 * kLookMargin}, {0, 900.0}});
  look.ranked[1].strength = 0.9;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), (std::vector{6, 18}));
  look.ranked[1].strength = 1.0;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), std::vector{18});
}

TEST(LookAnswerTest, KeepsALeakAndALittleSedimentationTogether) {
  EXPECT_EQ(NamesOf(AnswerOf(Looked({{2, 0.0}, {5, 40.0}, {0, 900.0}})), true),
            (std::vector{2, 5}));
  EXPECT_EQ(NamesOf(AnswerOf(Looked({{2, 0.0}, {5, 90.0}, {0, 900.0}})), true),
            std::vector{2});
}

TEST(LookAnswerTest, KeepsStopAndSupplyTogetherWhereTheBestFitsNotWell) {
  const auto named = [](double misfit) {
    return NamesOf(AnswerOf(Looked({{1, 0.0}, {16, 40.0}, {0, 900.0}}, misfit)),
                   true);
  };
  EXPECT_EQ(named(3.0), (std::vector{1, 16}));
  EXPECT_EQ(named(1.0), std::vector{1});
}

TEST(LookAnswerTest, AStopSaysEnoughUntilTheCommandHasGoneBothWays) {
  SecondLook look = Looked({{4, 0.0}, {1, 3.0}, {12, 4.0}, {0, 900.0}});
  look.complete = false;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), (std::vector{1, 4, 12}));
  look.ranked[0].strength = 1.0;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), (std::vector{1, 12}));
  EXPECT_EQ(AnswerOf(look).faults.size(), 3U) << "a later look may narrow it";
  look.ranked[1].distance = kLookMargin + 1.0;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), (std::vector{4, 12}));
}

TEST(LookAnswerTest, KeepsPerforationBesideASupplyDropWhereSupplyDecides) {
  SecondLook look = Looked({{16, 0.0}, {10, 40.0}, {0, 900.0}});
  look.perforation = look.ranked[1];
  look.perforation->distance = kLookMargin - 1.0;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), (std::vector{10, 16}));
  look.perforation->distance = kLookMargin + 1.0;
  EXPECT_EQ(NamesOf(AnswerOf(look), true), std::vector{16});
}

// If neither a fault nor health explains the data, observers made by the same
// simulation cannot either.
TEST(LookAnswerTest, IsUnknownWhereNotEvenNoFaultFits) {
  const auto outcome = [](double misfit) {
    return AnswerOf(Looked({{12, 0.0}, {0, 10.0}}, misfit)).outcome;
  };
  EXPECT_EQ(outcome(1.0), LookOutcome::kNothing);
  EXPECT_EQ(outcome(6.0), LookOutcome::kNoneFits);
}

TEST(LookAnswerTest, IsAShortlistBeyondFourFaults) {
  EXPECT_EQ(
      AnswerOf(Looked({{1, 0}, {2, 1}, {3, 1}, {10, 2}, {16, 2}})).outcome,
      LookOutcome::kUnclear);
}

// Where the force on the rod or what drives the flow is not measured, what the
// set does not tell apart binds the look: 5 of 900 are within its errors.
TEST(LookAnswerTest, GroupsBindALookThatLacksASignal) {
  const auto named = [](bool complete, const FaultGroups& groups) {
    SecondLook look =
        Looked({{12, 0.0}, {4, 45.0}, {3, 50.0}, {19, 60.0}, {0, 900.0}});
    look.complete = complete;
    LookAnswer answer = AnswerOf(look);
    BindGroups(groups, answer);
    return NamesOf(answer, true);
  };
  EXPECT_EQ(named(false, {}), std::vector{12});
  EXPECT_EQ(named(false, {{4, 12}, {3, 6}}), (std::vector{4, 12}));
  EXPECT_EQ(named(false, {{3, 6}}), std::vector{12});
  EXPECT_EQ(named(false, {{12, 19}}), std::vector{12});
  EXPECT_EQ(named(true, {{4, 12}}), std::vector{12});
}

TEST(LookAnswerTest, OfWhatChangedUnreadAMeterOrTheLineIsTheName) {
  const auto named = [](std::vector<std::pair<int, double>> distances) {
    distances.emplace_back(0, 900.0);
    const SecondLook look = Looked(std::move(distances));
    LookAnswer answer = AnswerOf(look);
    KeepMeterAndLine(look, answer);
    return NamesOf(answer, true);
  };
  EXPECT_EQ(named({{3, 0}, {6, 1}, {13, 1}, {17, 2}, {18, 2}, {19, 3}}),
            (std::vector{17, 19}));
  EXPECT_EQ(named({{3, 0}, {13, 1}, {19, 3}}), (std::vector{3, 13, 19}));
  EXPECT_EQ(named({{1, 0}, {3, 1}, {10, 1}, {13, 2}, {16, 2}}),
            std::vector<int>());
  // Slow data have few readings that count.
  EXPECT_EQ(named({{3, 0}, {17, 1}, {19, 1}, {0, 8}, {12, 9}, {7, 9}}),
            (std::vector{17, 19}));
}

// CV, X and F of a valve that moves a little.
Sample LivelySample(int k, std::int64_t stamp_ns) {
  Sample sample;
  sample.stamp_ns = stamp_ns;
  for (const Signal signal : {Signal::kCv, Signal::kX, Signal::kF}) {
    sample.Set(signal, 50.0 + k % 3);
  }
  return sample;
}

Verdict DetectedAt(std::int64_t stamp_ns) {
  Verdict verdict;
  verdict.transitions[0] = {TransitionKind::kDetected, stamp_ns, stamp_ns};
  verdict.transition_count = 1;
  return verdict;
}

// The flow of a valve without X is `share` of the usual from `from` on; rows
// `gap` to `from` are not read.
std::optional<LookTask> LookAfter(int gap, int from, double share) {
  EpisodeLooks looks(Looker());
  for (int k = 0; k < from + 200; ++k) {
    if (k >= gap && k < from) {
      continue;
    }
    Sample sample;
    sample.stamp_ns = k * kSecond;
    SetReadings({{60.0, 3555.0, 2615.0, 100.7}, 60.0, 17.0}, sample);
    sample.Set(Signal::kF, k < from ? 17.0 : 17.0 * share);
    sample.present =
        static_cast<SignalMask>(MaskOf(Signal::kCv) | MaskOf(Signal::kF));
    Verdict verdict = k == from + 2 ? DetectedAt(sample.stamp_ns) : Verdict{};
    if (auto task = looks.Step(sample, verdict)) {
      return task;
    }
  }
  return std::nullopt;
}

TEST(EpisodeLooksTest, SeesThatTheFlowChangedWhileNothingWasRead) {
  const auto changed = [](int gap, int from, double share) {
    const auto task = LookAfter(gap, from, share);
    return task && task->changed_unread;
  };
  EXPECT_TRUE(changed(200, 600, 1.25));
  EXPECT_TRUE(changed(200, 600, 0.75));
  EXPECT_FALSE(changed(200, 600, 1.0));
  EXPECT_FALSE(changed(500, 600, 1.25));
  EXPECT_FALSE(changed(600, 600, 1.25));
}

// An episode of the engine, abnormal from `first` on.
std::vector<LookTask> Follow(int samples, int first,
                             SignalQuality quality = SignalQuality::kGood) {
  EpisodeLooks looks(Looker());
  std::vector<LookTask> tasks;
  for (int k = 0; k < samples; ++k) {
    Sample sample = LivelySample(k, k * kSecond);
    if (k % 2 == 0 && quality == SignalQuality::kUncertain) {
      sample.quality.fill(quality);
    }
    const Verdict verdict =
        k == first + 1 ? DetectedAt(first * kSecond) : Verdict{};
    if (auto task = looks.Step(sample, verdict)) {
      tasks.push_back(std::move(*task));
    }
  }
  return tasks;
}

TEST(EpisodeLooksTest, LooksOftenInFiveMinutesFromTwoMinutesBefore) {
  const std::vector<LookTask> tasks = Follow(700, 200);
  ASSERT_EQ(tasks.size(), 4U);
  EXPECT_EQ(tasks[0].stamp_ns, 220 * kSecond);
  EXPECT_TRUE(tasks[0].early());
  EXPECT_EQ(tasks[1].stamp_ns, 240 * kSecond);
  EXPECT_FALSE(tasks[1].early());
  EXPECT_EQ(tasks[1].window.detection, 120U);
  EXPECT_EQ(tasks[1].window.rows.size(), 161U);
  EXPECT_EQ(tasks[3].stamp_ns, 500 * kSecond);
}

// While something is on top, a look at the episode would see both.
TEST(EpisodeLooksTest, WhatIsOnTopIsLookedAtInFiveMinutes) {
  EpisodeLooks looks(Looker());
  std::vector<std::pair<std::int64_t, LookOccasion>> due;
  for (int k = 0; k < 1600; ++k) {
    Sample sample = LivelySample(k, k * kSecond);
    Verdict verdict = k == 201 ? DetectedAt(200 * kSecond) : Verdict{};
    verdict.second.open = k >= 850;
    verdict.second.detection_stamp_ns = 810 * kSecond;
    verdict.second.standing_strength = -0.3;
    if (const auto task = looks.Step(sample, verdict)) {
      due.emplace_back(k, task->occasion);
      if (task->occasion == LookOccasion::kSecond) {
        EXPECT_EQ(task->detection_stamp_ns, 810 * kSecond);
        EXPECT_NEAR(static_cast<double>(task->window.detection), 120.0, 1.0);
        EXPECT_EQ(task->window.standing_strength, -0.3);
        EXPECT_FALSE(task->early() || task->late());
      }
    }
  }
  using enum LookOccasion;
  EXPECT_EQ(due, (std::vector<std::pair<std::int64_t, LookOccasion>>{
                     {220, kEpisode},
                     {240, kEpisode},
                     {350, kEpisode},
                     {500, kEpisode},
                     {800, kEpisode},
                     {850, kSecond},
                     {960, kSecond},
                     {1110, kSecond}}));
}

TEST(EpisodeLooksTest, ThenAtTwiceTheAgeEach) {
  const std::vector<LookTask> tasks = Follow(3000, 200);
  ASSERT_EQ(tasks.size(), 7U);
  EXPECT_EQ(tasks[4].stamp_ns, (200 + 600) * kSecond);
  EXPECT_EQ(tasks[5].stamp_ns, (200 + 1200) * kSecond);
  EXPECT_EQ(tasks[6].stamp_ns, (200 + 2400) * kSecond);
}

// The clock of the publisher is set back by an hour, 60 s into an episode: the
// looks come as if time had gone on, at what came since.
TEST(EpisodeLooksTest, AClockThatIsSetBackPutsNoLookOff) {
  EpisodeLooks looks(Looker());
  std::vector<LookTask> tasks;
  for (int k = 0; k < 1000; ++k) {
    Sample sample;
    sample.stamp_ns = (k < 260 ? 10000 + k : 10000 + k - 3600) * kSecond;
    SetReadings({{60.0, 3555.0, 2615.0, 100.7}, 60.0, 10.0}, sample);
    Verdict verdict;
    verdict.quality = Quality::kLive;
    if (k == 200) {
      verdict.transitions[0] = {TransitionKind::kDetected, sample.stamp_ns,
                                sample.stamp_ns};
      verdict.transition_count = 1;
    }
    if (auto task = looks.Step(sample, verdict)) {
      tasks.push_back(std::move(*task));
    }
  }
  ASSERT_EQ(tasks.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    constexpr int kAges[] = {20, 40, 150, 300, 600};
    EXPECT_EQ(tasks[i].age_ns(), kAges[i] * kSecond);
    EXPECT_EQ(tasks[i].early(), i == 0);
    EXPECT_EQ(tasks[i].late(), i == 4);
  }
  EXPECT_EQ(tasks[2].window.rows.size(), 91U) << "since the clock was set";
  EXPECT_EQ(tasks[2].window.detection, 0U);
}

TEST(EpisodeLooksTest, ManagesWithoutALeadIn) {
  const std::vector<LookTask> tasks = Follow(100, 0);
  ASSERT_EQ(tasks.size(), 2U);
  EXPECT_EQ(tasks[0].window.detection, 0U);
}

// Every second sample; a task needs 20 that were measured.
TEST(EpisodeLooksTest, KnowsWhatWasMeasured) {
  EXPECT_EQ(Follow(30, 0).size(), 1U);
  EXPECT_TRUE(Follow(30, 0, SignalQuality::kUncertain).empty());
  const std::vector<LookTask> tasks = Follow(400, 0, SignalQuality::kUncertain);
  ASSERT_FALSE(tasks.empty());
  EXPECT_FALSE(tasks[0].window.rows[0].x_measured);
  EXPECT_FALSE(tasks[0].window.rows[0].flow_measured);
  EXPECT_TRUE(tasks[0].window.rows[1].x_measured);
}

// Routine looks at a healthy valve that has `signals`.
int LooksWith(SignalMask signals) {
  EpisodeLooks looks(Looker());
  int count = 0;
  for (int k = 0; k < 1000; ++k) {
    Sample sample;
    sample.stamp_ns = k * kSecond;
    SetReadings({{60.0, 3555.0, 2615.0, 100.7}, 60.0, 10.0}, sample);
    sample.present = signals;
    Verdict verdict;
    verdict.quality = Quality::kLive;
    count += looks.Step(sample, verdict) ? 1 : 0;
  }
  return count;
}

// Without the command, or both X and F, there is nothing that the physics could
// explain.
TEST(EpisodeLooksTest, TakesNoLookWithoutCommandAndAnAnswerToIt) {
  const SignalMask cv = MaskOf(Signal::kCv);
  const SignalMask x = MaskOf(Signal::kX);
  const SignalMask f = MaskOf(Signal::kF);
  EXPECT_EQ(LooksWith(cv), 0);
  EXPECT_EQ(LooksWith(f), 0);
  EXPECT_EQ(LooksWith(x), 0);
  EXPECT_EQ(LooksWith(static_cast<SignalMask>(x | f)), 0);
  EXPECT_EQ(LooksWith(static_cast<SignalMask>(cv | x)), 2);
  EXPECT_EQ(LooksWith(static_cast<SignalMask>(cv | f)), 2);
}

// One sample in `period_s`: as many rows as of a sample a second, later.
TEST(EpisodeLooksTest, SlowDataAreLookedAtLaterAndNotMoreOften) {
  ValvePhysics slow = Physics();
  slow.drive.period_s = 60.0;
  const ValveLooker slow_looker(slow);
  EpisodeLooks looks(slow_looker);
  std::vector<std::pair<int, bool>> due;  // Row, and whether it is early.
  for (int k = 0; k < 700; ++k) {
    Sample sample = LivelySample(k, 60 * k * kSecond);
    Verdict verdict = k == 201 ? DetectedAt(60 * 200 * kSecond) : Verdict{};
    if (const auto task = looks.Step(sample, verdict)) {
      due.emplace_back(k, task->early());
      EXPECT_FALSE(task->late());
    }
  }
  EXPECT_EQ(due, (std::vector<std::pair<int, bool>>{
                     {220, true}, {240, false}, {350, false}, {500, false}}));
}

// If an episode goes on after a gap, the valve is looked at again as soon as
// after a detection: it may be another one.
TEST(EpisodeLooksTest, BehindAGapALookDoesNotWait) {
  EpisodeLooks looks(Looker());
  std::vector<int> due;
  for (int k = 0; k < 1500; ++k) {
    Sample sample = LivelySample(k, (k < 900 ? k : k + 60) * kSecond);
    Verdict verdict = k == 201 ? DetectedAt(200 * kSecond) : Verdict{};
    if (const auto task = looks.Step(sample, verdict)) {
      due.push_back(k);
      EXPECT_TRUE(k < 900 || task->window.detection == 0U);
    }
  }
  EXPECT_EQ(due, (std::vector<int>{220, 240, 350, 500, 800, 940}));
}

// The simulation takes no such inputs and would throw.
TEST(EpisodeLooksTest, TransmittersThatFailLowDoNotEndALook) {
  EpisodeLooks looks(Looker());
  std::optional<LookTask> task;
  for (int k = 0; k < 1000 && !task; ++k) {
    Sample sample;
    sample.stamp_ns = k * kSecond;
    SetReadings({{60.0, -90.0, -0.5, k % 2 == 0 ? -40.0 : 390.0}, 60.0, 10.0},
                sample);
    Verdict verdict;
    verdict.quality = Quality::kLive;
    task = looks.Step(sample, verdict);
  }
  ASSERT_TRUE(task);
  EXPECT_GT(MisfitWithoutFault(Physics(), task->window), kHealthyMisfit);
}

// Its first sample is rejected, but ends the episode of the source before.
TEST(EpisodeLooksTest, ANewSourceEndsTheLooksAtTheEpisodeBefore) {
  EpisodeLooks looks(Looker());
  std::vector<LookTask> tasks;
  for (int k = 0; k < 1000; ++k) {
    Sample sample;
    sample.stamp_ns = k * kSecond;
    SetReadings({{60.0, 3555.0, 2615.0, 100.7}, 60.0, 10.0}, sample);
    Verdict verdict;
    verdict.quality = Quality::kLive;
    if (k == 100 || k == 130) {
      verdict.transitions[0] = {
          k == 100 ? TransitionKind::kDetected : TransitionKind::kClosed,
          sample.stamp_ns, 100 * kSecond};
      verdict.transition_count = 1;
    }
    verdict.intake = k == 130 ? Intake::kRange : Intake::kAccepted;
    if (auto task = looks.Step(sample, verdict)) {
      tasks.push_back(std::move(*task));
    }
  }
  ASSERT_EQ(tasks.size(), 3U);
  EXPECT_EQ(tasks[0].stamp_ns, 120 * kSecond);
  EXPECT_EQ(tasks[1].occasion, LookOccasion::kRoutine);
  EXPECT_EQ(tasks[1].stamp_ns, 600 * kSecond);
}

TEST(LookAnswerTest, AnEarlyOneHasAWiderSetAndDoesNotOverruleObservers) {
  const SecondLook look = Looked({{19, 0.0}, {3, 31.0}, {0, 535.0}});
  EXPECT_EQ(NamesOf(AnswerOf(look), false), std::vector{19});
  EXPECT_EQ(NamesOf(AnswerOf(look, true), false), (std::vector{3, 19}));
  EXPECT_EQ(NamesOf(AnswerOf(look, true), true), std::nullopt);

  ModelSet models;
  models.faults = {3, kFirstFinding};
  EXPECT_FALSE(ObserversName(models, 0b10));
  EXPECT_TRUE(ObserversName(models, 0b11));

  LookBook book;
  LookTask task;
  task.stamp_ns = 20 * kSecond;
  book.Enter(task, AnswerOf(look, task.early()));
  task.stamp_ns = 40 * kSecond;
  book.Enter(task, AnswerOf(Looked({{3, 0.0}, {0, 900.0}}, 3.0), task.early()));
  ASSERT_NE(book.At(0, 60 * kSecond), nullptr);
  EXPECT_EQ(book.At(0, 60 * kSecond)->faults.front().fault, 3);
}

TEST(LookAnswerTest, ALateOneNamesWhatAShiftWouldExplainToo) {
  LookTask task;
  task.stamp_ns = 300 * kSecond;
  EXPECT_FALSE(task.late());
  task.stamp_ns = 600 * kSecond;
  EXPECT_TRUE(task.late());
  task.occasion = LookOccasion::kRoutine;
  EXPECT_FALSE(task.late());

  LookAnswer answer = AnswerOf(Looked({{0, 0.0}, {19, 3.0}, {2, 5.0}}));
  ASSERT_EQ(answer.outcome, LookOutcome::kNothing);
  EXPECT_EQ(NamesOf(answer, true), std::nullopt);
  answer.late = true;
  EXPECT_EQ(NamesOf(answer, true), (std::vector{2, 19}));
  answer = AnswerOf(Looked({{0, 0.0}}));
  answer.late = true;
  EXPECT_EQ(NamesOf(answer, true), std::nullopt);
  answer = AnswerOf(
      Looked({{0, 0.0}, {1, 1.0}, {2, 1.0}, {3, 1.0}, {4, 1.0}, {11, 1.0}}));
  answer.late = true;
  EXPECT_EQ(NamesOf(answer, true), std::nullopt);
}

TEST(LookBookTest, CountsAfterItsDelayAndDoesNotHearAWorseFit) {
  LookBook book;
  LookTask task;
  task.detection_stamp_ns = 7;
  task.stamp_ns = 100 * kSecond;
  book.Enter(task, AnswerOf(Looked({{1, 0.0}})));
  task.stamp_ns = 200 * kSecond;
  book.Enter(task, AnswerOf(Looked({{2, 0.0}}, 3.0)));
  EXPECT_EQ(book.At(7, 109 * kSecond), nullptr);
  ASSERT_NE(book.At(7, 110 * kSecond), nullptr);
  EXPECT_EQ(book.At(7, 300 * kSecond)->faults.front().fault, 1);
  task.stamp_ns = 300 * kSecond;
  const LookAnswer nothing = AnswerOf(Looked({{2, 0.0}, {0, 10.0}}));
  ASSERT_EQ(nothing.outcome, LookOutcome::kNothing);
  book.Enter(task, nothing);
  EXPECT_EQ(book.At(7, 400 * kSecond)->faults.front().fault, 1);
  EXPECT_EQ(book.At(8, 300 * kSecond), nullptr);
}

// Looks of one episode at twice the age each, from 300 s on.
class LateLookTest : public ::testing::Test {
 protected:
  // @returns the faults of the name then.
  std::vector<int> Look(std::vector<std::pair<int, double>> distances) {
    distances.emplace_back(0, 900.0);
    LookTask task;
    task.stamp_ns = age_;
    book_.Enter(task, AnswerOf(Looked(std::move(distances))));
    const LookAnswer* answer = book_.At(0, age_ + kLookDelayNs);
    age_ *= 2;
    return NamesOf(*answer, true).value();
  }

  LookBook book_;
  std::int64_t age_{300 * kSecond};
};

TEST_F(LateLookTest, ANameGetsNarrowerAtOnceAndNotWider) {
  EXPECT_EQ(Look({{3, 0.0}, {19, 3.0}}), (std::vector{3, 19}));
  EXPECT_EQ(Look({{19, 0.0}, {3, 30.0}}), std::vector{19});
  EXPECT_EQ(Look({{19, 0.0}, {3, 3.0}}), std::vector{19});
  EXPECT_EQ(Look({{3, 0.0}, {19, 3.0}}), std::vector{19});
  EXPECT_EQ(Look({{3, 0.0}, {19, 3.0}, {1, 1.0}, {10, 1.0}, {16, 1.0}}),
            std::vector{19});
}

TEST_F(LateLookTest, AnotherNameTakesTwoLooksInARow) {
  EXPECT_EQ(Look({{3, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{13, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{3, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{13, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{6, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{13, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{13, 0.0}, {1, 1.0}}), (std::vector{1, 13}));
  EXPECT_EQ(Look({{13, 0.0}}), std::vector{13});
}

// In the first minutes each look knows more than the one before.
TEST_F(LateLookTest, AnEarlierLookIsHeardWhateverItNames) {
  age_ = 40 * kSecond;
  EXPECT_EQ(Look({{3, 0.0}}), std::vector{3});
  EXPECT_EQ(Look({{13, 0.0}}), std::vector{13});
  EXPECT_EQ(Look({{13, 0.0}, {3, 1.0}}), (std::vector{3, 13}));
}

TEST(SecondLookTest, KnowsAHealthyWindowWithoutTryingFaults) {
  EXPECT_LT(MisfitWithoutFault(Physics(), Window({})), kHealthyMisfit);
  EXPECT_GT(MisfitWithoutFault(Physics(), Window({Abrupt(13, -0.2)})),
            kHealthyMisfit + kRoutineGain);
}

// A valve with an engine that sees nothing but what routine looks suspect, as
// the monitor and `fdi-trainer evaluate` connect the two.
class RoutineLookTest : public ::testing::Test {
 protected:
  void Feed(const std::vector<RecordRow>& rows) {
    for (const RecordRow& row : rows) {
      Step(row);
    }
  }

  void Step(const RecordRow& row) {
    Sample sample;
    sample.stamp_ns = count_ * kSecond;
    SetReadings(row, sample);
    Verdict verdict;
    verdict.stamp_ns = sample.stamp_ns;
    verdict.quality = quality_;
    verdict.detected = looks_.suspects();
    if (verdict.detected != open_) {
      open_ = verdict.detected;
      detection_ns_ = open_ ? sample.stamp_ns : detection_ns_;
      verdict.transitions[0] = {
          open_ ? TransitionKind::kDetected : TransitionKind::kCleared,
          sample.stamp_ns, detection_ns_};
      verdict.transition_count = 1;
      (open_ ? opened_ : cleared_).push_back(count_);
    }
    if (const auto task = looks_.Step(sample, verdict)) {
      due_.emplace_back(count_, task->occasion);
      compared_.push_back(
          std::ranges::count_if(task->window.rows, &RecordRow::x_measured));
      looks_.Enter(*task, TakeLook(Looker(), *task).value());
    }
    ++count_;
  }

  ValveLooks looks_{Looker()};
  Quality quality_{Quality::kLive};
  std::int64_t count_{0};
  std::int64_t detection_ns_{0};
  bool open_{false};
  std::vector<std::pair<std::int64_t, LookOccasion>> due_;
  std::vector<std::ptrdiff_t> compared_;  // Positions of the window.
  std::vector<std::int64_t> opened_;
  std::vector<std::int64_t> cleared_;
};

TEST_F(RoutineLookTest, OpensAndNamesAnEpisodeUntilTheValveIsHealthyAgain) {
  Feed(Recording(1080, 2, {Abrupt(13, -0.2)}));
  ASSERT_EQ(opened_.size(), 1U);
  EXPECT_EQ(opened_[0], 900 + 60 + 1);  // The second look, its delay.
  ASSERT_NE(looks_.Answer(), nullptr);
  EXPECT_EQ(NamesOf(*looks_.Answer(), false), std::vector{13});
  EXPECT_NEAR(looks_.Answer()->faults.front().strength, -0.2, 0.05);
  EXPECT_TRUE(cleared_.empty());

  Feed(Recording(700, 3, {}));
  ASSERT_EQ(cleared_.size(), 1U);
  EXPECT_EQ(cleared_[0], 1500 + 60 + 1);  // The first without the fault.
  EXPECT_EQ(looks_.Answer(), nullptr);
  EXPECT_EQ(opened_.size(), 1U);
}

TEST_F(RoutineLookTest, FindsNothingInAHealthyValve) {
  Feed(Recording(1100, 4, {}));
  using enum LookOccasion;
  EXPECT_EQ(due_, (std::vector<std::pair<std::int64_t, LookOccasion>>{
                      {600, kRoutine}, {900, kRoutine}}));
  EXPECT_TRUE(opened_.empty());
}

TEST_F(RoutineLookTest, TakesOnlyWindowsThatAreJudgedThroughout) {
  const std::vector<RecordRow> rows = Recording(1000, 4, {});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    quality_ = k == 300 ? Quality::kInhibited : Quality::kLive;
    Step(rows[k]);
  }
  ASSERT_EQ(due_.size(), 1U);
  EXPECT_EQ(due_[0].first, 900);  // 420 rows since.
}

// Else a valve that passes the end of its range now and then would have none.
TEST_F(RoutineLookTest, DoesNotCompareWhatIsOutsideTheTaughtRange) {
  const std::vector<RecordRow> rows = Recording(1000, 4, {});
  for (std::size_t k = 0; k < rows.size(); ++k) {
    RecordRow row = rows[k];
    const bool outside = k % 10 == 0 && k >= 700;
    row.x_pct += outside ? 30.0 : 0.0;
    quality_ = outside ? Quality::kUncovered : Quality::kLive;
    Step(row);
  }
  EXPECT_EQ(compared_, (std::vector<std::ptrdiff_t>{420, 399}));
  EXPECT_EQ(due_.back().first, 900);
  EXPECT_TRUE(opened_.empty());

  quality_ = Quality::kUncovered;  // Parked for a while: too little is left.
  Feed(Recording(600, 5, {}));
  EXPECT_EQ(due_.size(), 2U);
}

TEST(SuspicionTest, TakesTwoLooksInARowThatNameTheSameFault) {
  const auto named = [](int fault) {
    LookAnswer answer = AnswerOf(Looked({{fault, 0.0}, {0, 900.0}}));
    answer.without_fault = 3.0;
    return answer;
  };
  LookAnswer healthy;
  healthy.outcome = LookOutcome::kNothing;
  healthy.without_fault = 1.0;
  Suspicion suspicion;
  auto after = [&suspicion,
                k = std::int64_t{0}](const LookAnswer& answer) mutable {
    k += 300 * kSecond;
    suspicion.Enter(k, answer);
    suspicion.Advance(k + kRoutineDelayNs - 1);
    const bool before = suspicion.found() != nullptr;
    suspicion.Advance(k + kRoutineDelayNs);
    return std::pair(before, suspicion.found() != nullptr);
  };
  EXPECT_EQ(after(named(12)), (std::pair(false, false)));
  EXPECT_EQ(after(healthy), (std::pair(false, false)));
  EXPECT_EQ(after(named(12)), (std::pair(false, false)));
  EXPECT_EQ(after(named(3)), (std::pair(false, false)));
  EXPECT_EQ(after(named(3)), (std::pair(false, true)));
  EXPECT_EQ(after(named(12)), (std::pair(true, true)));
  EXPECT_EQ(after(healthy), (std::pair(true, false)));
}

// The clock is set back by an hour, just after a look.
TEST(SuspicionTest, WhatComesFromALaterTimeHoldsUpNothing) {
  LookAnswer named = AnswerOf(Looked({{13, 0.0}, {0, 900.0}}));
  named.without_fault = 3.0;
  Suspicion suspicion;
  suspicion.Enter(5000 * kSecond, named);
  suspicion.Advance(5010 * kSecond);
  for (const std::int64_t k : {1500, 1800}) {
    suspicion.Enter(k * kSecond, named);
    suspicion.Advance(k * kSecond + kRoutineDelayNs);
    EXPECT_EQ(suspicion.found() != nullptr, k == 1800);
  }

  LookBook book;
  LookTask task;
  task.stamp_ns = 5000 * kSecond;
  book.Enter(task, named);
  EXPECT_EQ(book.At(0, 5009 * kSecond), nullptr);
  EXPECT_NE(book.At(0, 5010 * kSecond), nullptr);
  EXPECT_NE(book.At(0, 1411 * kSecond), nullptr);
}

}  // namespace
}  // namespace fdi::simulator
