// The ends of the rod's and the actuator's travel.
#include <gtest/gtest.h>

#include "simulator/control_valve.h"
#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

ProcessInputs InputsAt(double command) {
  return {command, 3555e3, 2615e3, 100.7};
}

// Holds `command` for `duration_s` in periods of a second.
void Hold(ControlValve& valve, double command, int duration_s) {
  for (int k = 0; k < duration_s; ++k) {
    valve.Advance(1.0, InputsAt(command), InputsAt(command));
  }
}

TEST(ValveStopsTest, RodStopsAtTheTravelsEndsAndLeavesThem) {
  ControlValve valve(ParameterSet("lublin-actuator-3"), 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects clogged;
  clogged.upper_stop_factor = 0.6;
  valve.SetEffects(clogged);
  Hold(valve, 0.9, 60);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.6);
  EXPECT_EQ(valve.state().velocity, 0.0);
  EXPECT_GT(valve.NetForce(), 0.0);
  Hold(valve, 0.4, 120);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.4), 2e-3);
  Hold(valve, 0.0, 120);
  EXPECT_NEAR(valve.state().rod, 0.0, 2e-3);
}

// While the stop holds the rod the actuator runs to the end of its own travel;
// the pressure built up meanwhile delays the rod's return.
TEST(ValveStopsTest, ActuatorGoesOnWhereAStopHoldsTheRod) {
  ControlValve valve(ParameterSet("lublin-actuator-3"), 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects clogged;
  clogged.upper_stop_factor = 0.6;
  valve.SetEffects(clogged);
  Hold(valve, 0.9, 60);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.6);
  EXPECT_DOUBLE_EQ(valve.state().actuator, 1.25);
  EXPECT_NEAR(valve.state().chamber_pressure_pa - 101325.0, 600e3, 1e3);
  Hold(valve, 0.5, 20);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.6);
  Hold(valve, 0.5, 60);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.5), 1e-2);
}

// The flow force opens the valve to the rod's end, the actuator to its own.
TEST(ValveStopsTest, ActuatorGoesOnBelowTheOpenEnd) {
  ControlValve valve(ParameterSet("lublin-actuator-3"), 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 0.0, 120);
  EXPECT_NEAR(valve.state().rod, 0.0, 1e-3);
  FaultEffects evaporation;
  ApplyFault(7, 1.0, evaporation);
  valve.SetEffects(evaporation);
  Hold(valve, 0.0, 30);
  EXPECT_EQ(valve.state().rod, 0.0);
  EXPECT_DOUBLE_EQ(valve.state().actuator, -0.05);
}

TEST(ValveStopsTest, StopThatMovesTakesTheRodAlong) {
  ControlValve valve(ParameterSet("lublin-actuator-3"), 1.0);
  valve.Settle(InputsAt(0.7));
  FaultEffects clogged;
  clogged.upper_stop_factor = 0.5;
  valve.SetEffects(clogged);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.5);
  EXPECT_EQ(valve.state().velocity, 0.0);
}

// At 240 kPa the diaphragm carries 6.96 kN; spring and flow need 7.5 kN when
// shut under 0.94 MPa.
TEST(ValveStopsTest, WeakSupplyCannotShutTheValve) {
  ValveParameters weak = ParameterSet("lublin-actuator-3");
  weak.actuator.supply_pressure_gauge_pa = 240e3;
  ControlValve valve(weak, 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 1.0, 200);
  EXPECT_LT(valve.state().rod, 0.99);
  EXPECT_GT(valve.state().rod, 0.85);
  EXPECT_NEAR(valve.state().chamber_pressure_pa - 101325.0, 240e3, 1e3);
}

}  // namespace
}  // namespace fdi::simulator
