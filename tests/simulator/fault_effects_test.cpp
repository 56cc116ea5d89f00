#include "simulator/fault_effects.h"

#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "simulator/record_fit.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

std::vector<InputRow> RisingCommand() {
  std::vector<InputRow> rows;
  for (int k = 0; k < 60; ++k) {
    rows.push_back({30.0 + k, 3500.0 + 5.0 * (k % 7), 2600.0, 100.0});
  }
  return rows;
}

// Without noise, `fault` at half its strength from the start; 0 is none.
std::vector<Sample> Answers(int fault) {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3");
  config.excitation = RecordedExcitation{RisingCommand()};
  config.noise = false;
  config.resolution = false;
  if (fault != 0) {
    FaultSchedule schedule;
    schedule.fault = fault;
    schedule.final_strength = 0.5;
    config.faults = {schedule};
  }
  ValveSimulation simulation(config);
  std::vector<Sample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step().sample);
  }
  return samples;
}

TEST(FaultEffectsTest, StrengthZeroLeavesTheValveHealthy) {
  FaultEffects effects;
  for (int fault = 1; fault <= kLastFault; ++fault) {
    ApplyFault(fault, 0.0, effects);
  }
  EXPECT_EQ(effects, FaultEffects{});
}

TEST(FaultEffectsTest, EveryFaultChangesSomething) {
  for (int fault = 1; fault <= kLastFault; ++fault) {
    FaultEffects effects;
    ApplyFault(fault, 0.5, effects);
    EXPECT_NE(effects, FaultEffects{}) << FaultName(fault);
  }
}

TEST(FaultEffectsTest, FaultsCombine) {
  FaultEffects effects;
  ApplyFault(1, 0.5, effects);
  ApplyFault(2, 1.0, effects);
  ApplyFault(19, 0.25, effects);
  EXPECT_DOUBLE_EQ(effects.upper_stop_factor, 0.5 * 0.8);
  EXPECT_DOUBLE_EQ(effects.kv_factor, 0.8);
  EXPECT_DOUBLE_EQ(effects.flow_reading_factor, 0.75);
}

TEST(FaultEffectsTest, SignOfPressureFaultChoosesTheSide) {
  FaultEffects positive;
  ApplyFault(17, 0.5, positive);
  EXPECT_DOUBLE_EQ(positive.outlet_factor, 0.5);
  EXPECT_DOUBLE_EQ(positive.inlet_factor, 1.0);
  FaultEffects negative;
  ApplyFault(17, -0.5, negative);
  EXPECT_DOUBLE_EQ(negative.inlet_factor, 0.5);
  EXPECT_DOUBLE_EQ(negative.outlet_factor, 1.0);
}

TEST(FaultEffectsTest, RefusesUnknownFaultsAndStrengths) {
  FaultEffects effects;
  EXPECT_THROW(ApplyFault(0, 0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(kLastFault + 1, 0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(1, -0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(19, 1.5, effects), std::invalid_argument);
}

// The oracle is the integration with the fault.
TEST(FaultEffectsTest, WhatLeavesTheRodAndWhatShowsInItAlone) {
  const std::vector<InputRow> rows = RisingCommand();
  const std::vector<Sample> healthy = Answers(0);
  for (int fault = 1; fault <= kLastFault; ++fault) {
    FaultEffects effects;
    ApplyFault(fault, 0.5, effects);
    bool same = true;
    bool same_at_position = true;
    const std::vector<Sample> faulty = Answers(fault);
    for (std::size_t k = 0; k < faulty.size(); ++k) {
      const double x = faulty[k][Signal::kX];
      same = same && x == healthy[k][Signal::kX];
      const double usual =
          FlowReading(ParameterSet("lublin-actuator-3"), {}, rows[k], x);
      same_at_position =
          same_at_position && std::abs(faulty[k][Signal::kF] - usual) < 1e-9;
      for (const Signal signal : {Signal::kP1, Signal::kP2, Signal::kT1}) {
        same_at_position =
            same_at_position && faulty[k][signal] == healthy[k][signal];
      }
      // At the end of its range, a reading of X no longer tells the rod.
      if (effects.position_reading_step == 0.0 || x < 100.0) {
        EXPECT_NEAR(
            FlowReading(ParameterSet("lublin-actuator-3"), effects, rows[k], x),
            faulty[k][Signal::kF], 1e-9)
            << FaultName(fault);
      }
    }
    EXPECT_EQ(LeavesRod(fault), same) << FaultName(fault);
    EXPECT_EQ(ShowsInRodAlone(fault), same_at_position) << FaultName(fault);
  }
  EXPECT_THROW(LeavesRod(0), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::simulator
