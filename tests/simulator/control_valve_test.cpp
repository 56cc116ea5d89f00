#include "simulator/control_valve.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "simulator/random.h"
#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

ProcessInputs InputsAt(double command) {
  return {command, 3555e3, 2615e3, 100.7};
}

// Without play and dead zone, so that the static map is exact.
ValveParameters Exact() {
  ValveParameters valve = ParameterSet("paper-operating-point");
  valve.actuator.play_fraction = 0.0;
  return valve;
}

// Holds `command` for `duration_s` in periods of a second.
void Hold(ControlValve& valve, double command, int duration_s) {
  for (int k = 0; k < duration_s; ++k) {
    valve.Advance(1.0, InputsAt(command), InputsAt(command));
  }
}

TEST(ControlValveTest, RodSettlesOnTheLeversStaticMap) {
  ControlValve valve(Exact(), 1.0);
  valve.Settle(InputsAt(0.5));
  for (const double command : {0.1, 0.3, 0.7, 0.9, 0.45}) {
    Hold(valve, command, 90);
    EXPECT_NEAR(valve.state().rod, LeverPosition(command), 1e-3) << command;
  }
}

TEST(ControlValveTest, RodStaysWithinThePlayOfTheStaticMap) {
  ControlValve valve(ParameterSet("paper-operating-point"), 1.0);
  valve.Settle(InputsAt(0.5));
  for (const double command : {0.6, 0.4}) {
    Hold(valve, command, 90);
    EXPECT_NEAR(valve.state().rod, LeverPosition(command), 1e-3) << command;
    const double gap = valve.state().actuator - valve.state().rod;
    EXPECT_NEAR(gap, command > 0.5 ? 0.005 : -0.005, 1e-3) << command;
  }
}

TEST(ControlValveTest, SettledValveStaysAtRest) {
  for (const std::string& name : ParameterSetNames()) {
    ControlValve valve(ParameterSet(name), 1.0);
    valve.Settle(InputsAt(0.7));
    const double rod = valve.state().rod;
    EXPECT_NEAR(rod, LeverPosition(0.7), 1e-3) << name;
    Hold(valve, 0.7, 60);
    EXPECT_NEAR(valve.state().rod, rod, 1e-4) << name;
  }
}

// (14) at rest, written out with the benchmark's numbers.
TEST(ControlValveTest, ForcesBalanceAtRest) {
  const ValveParameters parameters = Exact();
  ControlValve valve(parameters, 1.0);
  valve.Settle(InputsAt(0.3));
  Hold(valve, 0.6, 120);

  const ValveState s = valve.state();
  const double spring = 60892.0 * (s.rod * 0.0381 + 0.009525);
  const double flow = (3555e3 - 2615e3) /
                      RecoveryCoefficient(parameters.trim, s.rod) * 1.9635e-3;
  const double diaphragm = (s.chamber_pressure_pa - 101325.0) * 0.0290;
  EXPECT_NEAR(diaphragm + 2.0 * 9.81 - spring - flow, 0.0, 1.0);
  EXPECT_NEAR(valve.NetForce(), 0.0, 1.0);
}

// The air that (16) lets in is the air in the chamber: trapezoids over 1 ms.
TEST(ControlValveTest, ChamberKeepsItsMassBalance) {
  const ValveParameters parameters = ParameterSet("lublin-actuator-3-refit");
  ControlValve valve(parameters, 0.1);
  valve.Settle(InputsAt(0.5));
  const double supply = 101325.0 + 600e3;
  const auto rate = [&](const ValveState& s) {
    return s.signal > 0.0
               ? s.signal * 2.5e-3 * AirFlow(supply, s.chamber_pressure_pa)
               : s.signal * 1.45e-3 * AirFlow(s.chamber_pressure_pa, 101325.0);
  };
  const double start = valve.state().air_mass_kg;
  double entered = 0.0;
  double moved = 0.0;
  for (int i = 0; i < 6000; ++i) {
    const double command = i < 3000 ? 0.8 : 0.4;
    const ValveState before = valve.state();
    valve.Advance(0.001, InputsAt(command), InputsAt(command));
    const ValveState after = valve.state();
    entered += 0.0005 * (rate(before) + rate(after));
    moved += std::abs(after.air_mass_kg - before.air_mass_kg);
    ASSERT_NEAR(after.air_mass_kg - start, entered, 5e-3 * moved + 5e-7);
  }
  EXPECT_GT(moved, 0.003);
}

TEST(ControlValveTest, FlowIsEquationTwelve) {
  ControlValve valve(Exact(), 1.0);
  valve.Settle(InputsAt(0.7167));
  const double x = valve.state().rod;
  const double rho = MediumAt({}, 3555e3, 2615e3, 100.7).density_kg_m3;
  EXPECT_NEAR(valve.FlowM3PerHour(InputsAt(0.7167), 0.0),
              100.0 * 63.0 * (1.0 - x) * std::sqrt(0.940 / rho), 1e-9);
}

// The relay of the benchmark: mdot = c if sqrt(dP), the dead zone's table in
// between, against the air that entered.
TEST(ControlValveTest, OrificeRelayFillsByTheRootOfThePressureDrop) {
  ValveParameters parameters = ParameterSet("lublin-actuator-3");
  ControlValve valve(parameters, 0.1);
  valve.Settle(InputsAt(0.3));
  valve.Advance(2.0, InputsAt(0.9), InputsAt(0.9));
  const ValveState before = valve.state();
  ASSERT_EQ(before.signal, 1.0);
  valve.Advance(0.001, InputsAt(0.9), InputsAt(0.9));
  const double drop = 701325.0 - before.chamber_pressure_pa;
  EXPECT_NEAR((valve.state().air_mass_kg - before.air_mass_kg) / 0.001,
              2.5e-6 * std::sqrt(drop), 0.01 * 2.5e-6 * std::sqrt(drop));
}

TEST(ControlValveTest, ColdStartReachesTheEquilibrium) {
  ControlValve valve(Exact(), 1.0);
  valve.ColdStart();
  EXPECT_EQ(valve.state().rod, 0.0);
  Hold(valve, 0.6, 120);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.6), 1e-3);
}

// Dead band of Coulomb friction: on a slow reversal the rod stands while the
// net force crosses from +F_f to -F_f, and never moves inside it.
TEST(ControlValveTest, FrictionHoldsTheRodInsideItsBand) {
  ValveParameters rough = Exact();
  rough.actuator.coulomb_friction_n = 200.0;
  ControlValve valve(rough, 1.0);
  valve.Settle(InputsAt(0.5));
  int held = 0;
  for (int i = 0; i < 6000; ++i) {
    const double command = 0.5 + 0.1 * std::sin(i * 0.01 * 0.2);
    const double before = valve.state().rod;
    valve.Advance(0.01, InputsAt(command), InputsAt(command));
    const ValveState after = valve.state();
    EXPECT_LE(std::abs(valve.NetForce()), 1.02 * 200.0 + 20.0);
    if (after.velocity == 0.0 && after.rod == before) {
      ++held;
    }
  }
  EXPECT_GT(held, 100);
  EXPECT_LT(held, 5900);
}

// With so little friction, 2 % are below the error of the integration: the rod
// would start and stop for ever.
TEST(ControlValveTest, HardlyAnyFrictionIsLikeNone) {
  for (const double scale : {1.0, 10.0}) {
    ValveParameters valve = ParameterSet("lublin-actuator-3");
    ControlValve without(valve, scale);
    valve.actuator.coulomb_friction_n = 0.2;
    ControlValve with(valve, scale);
    without.Settle(InputsAt(0.5));
    with.Settle(InputsAt(0.5));
    NormalSource noise(1, 2);
    double command = 0.5;
    for (int i = 0; i < 600; ++i) {
      const ProcessInputs from = InputsAt(command);
      command = 0.5 + 0.05 * noise();
      const ProcessInputs to = InputsAt(command);
      without.Advance(1.0, from, to);
      with.Advance(1.0, from, to);
      ASSERT_NEAR(with.state().rod, without.state().rod, 5e-3) << i;
    }
  }
}

TEST(ControlValveTest, FrictionDelaysTheRodBehindItsCommand) {
  const auto reversal_delay = [](double friction_n) {
    ValveParameters valve_parameters = Exact();
    valve_parameters.actuator.coulomb_friction_n = friction_n;
    ControlValve valve(valve_parameters, 1.0);
    valve.Settle(InputsAt(0.5));
    Hold(valve, 0.6, 60);
    const double top = valve.state().rod;
    int steps = 0;
    while (valve.state().rod > top - 0.005 && steps < 2000) {
      valve.Advance(0.01, InputsAt(0.55), InputsAt(0.55));
      ++steps;
    }
    return steps;
  };
  EXPECT_GT(reversal_delay(300.0), reversal_delay(0.0));
  EXPECT_LT(reversal_delay(300.0), 2000);
}

// A PI positioner removes the offset that a leak leaves with P alone.
TEST(ControlValveTest, IntegralActionRemovesTheOffsetOfALeak) {
  const auto offset = [](double integral_time_s) {
    ValveParameters parameters = Exact();
    parameters.positioner.gain = 10.0;
    parameters.positioner.integral_time_s = integral_time_s;
    ControlValve valve(parameters, 1.0);
    valve.Settle(InputsAt(0.5));
    FaultEffects leak;
    ApplyFault(9, 1.0, leak);
    valve.SetEffects(leak);
    Hold(valve, 0.5, 300);
    return LeverPosition(0.5) - valve.state().rod;
  };
  const double without = offset(std::numeric_limits<double>::infinity());
  EXPECT_GT(without, 2e-3);
  EXPECT_LT(std::abs(offset(1.0)), 0.1 * without);
}

TEST(ControlValveTest, SampledPositionerSettlesWhereTheContinuousOneDoes) {
  ValveParameters sampled = Exact();
  sampled.positioner.sampling_period_s = 0.035;
  ControlValve valve(sampled, 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 0.65, 60);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.65), 2e-3);
}

TEST(ControlValveTest, DerivativeActionSettlesToo) {
  ValveParameters derivative = Exact();
  derivative.positioner.derivative_time_s = 1.0;
  ControlValve valve(derivative, 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 0.65, 60);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.65), 1e-3);
}

// Backlash: half the width behind the actuator after each turn, at rest inside.
TEST(ControlValveTest, WidePlayInTheFeedbackMakesTheValveCycle) {
  ControlValve valve(ParameterSet("lublin-actuator-3"), 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects loose;
  ApplyFault(15, 0.75, loose);
  valve.SetEffects(loose);
  double low = 1.0;
  double high = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double command = 0.5 + 0.25 * std::sin(0.0628 * k);
    valve.Advance(1.0, InputsAt(command), InputsAt(command));
    low = std::min(low, valve.state().rod);
    high = std::max(high, valve.state().rod);
  }
  EXPECT_DOUBLE_EQ(high, 1.0);
  EXPECT_LT(low, 0.2);
}

// The feedback lags by half the width, on the other side after each turn.
TEST(ControlValveTest, PlayInTheFeedbackShiftsTheRodByHalfItsWidth) {
  ControlValve valve(Exact(), 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects loose;
  loose.feedback_play = 0.2;
  valve.SetEffects(loose);
  Hold(valve, 0.7, 120);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.8), 2e-3);
  Hold(valve, 0.65, 120);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.55), 2e-3);
}

// Without its limit the integral would grow to 20 in these 300 s and hold the
// rod at the stop for as long again.
TEST(ControlValveTest, IntegralDoesNotWindUpAtAStop) {
  ValveParameters parameters = Exact();
  parameters.positioner.integral_time_s = 5.0;
  ControlValve valve(parameters, 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects clogged;
  clogged.upper_stop_factor = 0.6;
  valve.SetEffects(clogged);
  Hold(valve, 0.9, 300);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.6);
  Hold(valve, 0.4, 30);
  EXPECT_NEAR(valve.state().rod, LeverPosition(0.4), 5e-3);
}

// 60 s for the stroke; starts at an error of 1 %, stops at half of it.
ValveParameters Electric() {
  ValveParameters valve = Exact();
  valve.actuator.drive = ActuatorDrive::kElectric;
  valve.positioner.filter_time_s = 0.01;
  return valve;
}

TEST(ControlValveTest, AMotorRunsAtConstantSpeedOutsideItsDeadBand) {
  ControlValve valve(Electric(), 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 0.509, 60);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.5);
  Hold(valve, 0.8, 10);
  EXPECT_NEAR(valve.state().rod, 0.5 + 10.0 / 60.0, 1e-3);
  Hold(valve, 0.8, 60);
  EXPECT_NEAR(valve.state().rod, 0.795, 1e-6);
  Hold(valve, 0.789, 60);
  EXPECT_NEAR(valve.state().rod, 0.795, 1e-6);
  Hold(valve, 0.7, 3);
  EXPECT_NEAR(valve.state().rod, 0.795 - 3.0 / 60.0, 1e-3);
  EXPECT_EQ(valve.state().signal, -1.0);
}

// Its torque switch opens there, and a stop that moves inwards takes its
// spindle along, so that it need not come back through travel that the rod
// never had.
TEST(ControlValveTest, AMotorStopsWhereTheRodIsBlocked) {
  ValveParameters parameters = Electric();
  parameters.actuator.play_fraction = 0.02;
  ControlValve valve(parameters, 1.0);
  valve.Settle(InputsAt(0.5));
  FaultEffects clogged;
  clogged.upper_stop_factor = 0.6;
  valve.SetEffects(clogged);
  Hold(valve, 0.9, 100);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.6);
  EXPECT_NEAR(valve.state().actuator, 0.61, 1e-6);
  EXPECT_EQ(valve.state().signal, 0.0);
  Hold(valve, 0.4, 6);
  EXPECT_NEAR(valve.state().rod, 0.62 - 6.0 / 60.0, 2e-3);
  clogged.upper_stop_factor = 0.3;
  valve.SetEffects(clogged);
  EXPECT_DOUBLE_EQ(valve.state().rod, 0.3);
  Hold(valve, 0.1, 6);
  EXPECT_NEAR(valve.state().rod, 0.32 - 6.0 / 60.0, 2e-3);
}

// Its switch is no sampled positioner, which would run on beyond a stop.
TEST(ControlValveTest, AMotorIsNotSampled) {
  ValveParameters parameters = Electric();
  parameters.positioner.sampling_period_s = 5.0;
  ControlValve valve(parameters, 1.0);
  valve.Settle(InputsAt(0.99));
  Hold(valve, 1.2, 20);
  EXPECT_NEAR(valve.state().actuator, 1.0, 1e-6);
}

// With the spring that closes and air that opens, the travel is mirrored; a
// motor has neither.
TEST(ControlValveTest, AMotorHasNoSpringSide) {
  ValveParameters parameters = Electric();
  parameters.actuator.spring = SpringAction::kToClose;
  ControlValve valve(parameters, 1.0);
  valve.Settle(InputsAt(0.5));
  Hold(valve, 0.2, 6);
  EXPECT_NEAR(valve.state().rod, 0.4, 1e-3);
}

TEST(ControlValveTest, BypassAddsItsOwnFlow) {
  ControlValve valve(Exact(), 1.0);
  const ProcessInputs inputs = InputsAt(0.7);
  valve.Settle(inputs);
  const double closed = valve.FlowM3PerHour(inputs, 0.0);
  const double rho = MediumAt({}, 3555e3, 2615e3, 100.7).density_kg_m3;
  EXPECT_NEAR(valve.FlowM3PerHour(inputs, 0.4) - closed,
              100.0 * 19.75 * 0.4 * std::sqrt(0.940 / rho), 1e-9);
}

}  // namespace
}  // namespace fdi::simulator
