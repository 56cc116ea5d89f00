#include "simulator/valve_equations.h"

#include <cmath>

#include <gtest/gtest.h>

namespace fdi::simulator {
namespace {

// A DN50 valve at 0.9 MPa passes 103 t/h at X 25 %, 29.4 at 50, 17.8 at 60 and
// 9.8 at 72 % (water of 43 degC).
TEST(ValveEquationsTest, FlowMatchesTheBenchmarksFigures) {
  const Trim trim;
  const auto tons = [&](double closing) {
    return Flow(trim.kv_m3_h, Opening(trim, closing), 0.9e6, 991.0) * 0.991;
  };
  EXPECT_NEAR(tons(0.25), 103.0, 1.0);
  EXPECT_NEAR(tons(0.50), 29.4, 0.3);
  EXPECT_NEAR(tons(0.60), 17.8, 0.2);
  EXPECT_NEAR(tons(0.72), 9.8, 0.1);
}

// Kv by definition: m3/h of water (1000 kg/m3) at 1 bar.
TEST(ValveEquationsTest, OpenValvePassesKvAtOneBar) {
  EXPECT_NEAR(Flow(63.0, 1.0, 1e5, 1000.0), 63.0, 1e-9);
}

TEST(ValveEquationsTest, FlowIsOddAndContinuousInThePressureDrop) {
  EXPECT_EQ(Flow(63.0, 1.0, 0.0, 1000.0), 0.0);
  EXPECT_DOUBLE_EQ(Flow(63.0, 1.0, -2e5, 1000.0),
                   -Flow(63.0, 1.0, 2e5, 1000.0));
  EXPECT_NEAR(Flow(63.0, 1.0, 999.999, 1000.0),
              Flow(63.0, 1.0, 1000.001, 1000.0), 1e-5);
}

TEST(ValveEquationsTest, OpeningFallsFromOneToZero) {
  for (const auto characteristic :
       {FlowCharacteristic::kLinear, FlowCharacteristic::kExponential}) {
    Trim trim;
    trim.characteristic = characteristic;
    EXPECT_EQ(Opening(trim, 0.0), 1.0);
    EXPECT_EQ(Opening(trim, 1.0), 0.0);
    EXPECT_EQ(Opening(trim, -0.1), 1.0);
    EXPECT_EQ(Opening(trim, 1.1), 0.0);
    for (int i = 1; i <= 1000; ++i) {
      EXPECT_LT(Opening(trim, i / 1000.0), Opening(trim, (i - 1) / 1000.0));
    }
  }
}

TEST(ValveEquationsTest, TablesReachTheirKnotsAndHoldTheirEnds) {
  EXPECT_DOUBLE_EQ(RecoveryCoefficient({}, 0.0), 1.0);
  EXPECT_NEAR(RecoveryCoefficient({}, 0.4), 0.785, 1e-12);
  EXPECT_NEAR(RecoveryCoefficient({}, 0.65), 0.64, 1e-12);
  EXPECT_NEAR(RecoveryCoefficient({}, 0.99), 0.45, 1e-9);
  EXPECT_NEAR(RecoveryCoefficient({}, 1.0), 0.40, 1e-12);
  EXPECT_NEAR(RecoveryCoefficient({}, 1.5), 0.40, 1e-12);
  EXPECT_NEAR(BypassRecoveryCoefficient(0.0), 0.45, 1e-12);
  EXPECT_NEAR(BypassRecoveryCoefficient(1.0), 1.0, 1e-12);
  EXPECT_NEAR(CriticalPressureRatio(0.0), 0.94, 1e-12);
  EXPECT_NEAR(CriticalPressureRatio(3447527.0), 0.84, 1e-12);
  EXPECT_NEAR(CriticalPressureRatio(1e9), 0.685, 1e-12);
}

TEST(ValveEquationsTest, ColdWaterDoesNotChoke) {
  const MediumState cold = MediumAt({}, 3.5e6, 2.6e6, 43.0);
  EXPECT_DOUBLE_EQ(
      EffectivePressureDrop(cold, RecoveryCoefficient({}, 0.7), 0.72), 0.9e6);
}

// At 268 degC the vapour pressure stands before the valve, and the drop is
// limited to Km (1 - rc) Pv.
TEST(ValveEquationsTest, BoilingWaterChokes) {
  const MediumState hot = MediumAt({}, 3.5e6, 2.6e6, 268.0);
  const double pv = std::pow(10.0, -2141.0 / 541.15 + 10.7167);
  EXPECT_DOUBLE_EQ(hot.inlet_pressure_pa, pv);
  const double drop = EffectivePressureDrop(hot, 0.61, 0.72);
  EXPECT_NEAR(drop, 0.61 * pv * (1.0 - CriticalPressureRatio(pv)), 1.0);
  EXPECT_LT(drop, pv - 2.6e6);
}

TEST(ValveEquationsTest, AirFlowMeetsAtTheCriticalRatioAndReverses) {
  EXPECT_NEAR(AirFlow(6e5, 3e5 + 0.01), AirFlow(6e5, 3e5 - 0.01), 1e-6);
  EXPECT_DOUBLE_EQ(AirFlow(6e5, 1e5), AirFlow(6e5, 2.9e5));
  EXPECT_DOUBLE_EQ(AirFlow(4e5, 5e5), -AirFlow(5e5, 4e5));
  EXPECT_EQ(AirFlow(3e5, 3e5), 0.0);
  EXPECT_NEAR(AirFlow(5e5, 4e5), 4.13e-6 * std::sqrt(1e5 * 4e5), 1e-12);
}

TEST(ValveEquationsTest, LeverIsUndoneByItsInverse) {
  for (int i = 0; i <= 20; ++i) {
    EXPECT_NEAR(LeverAngle(LeverPosition(i / 20.0)), i / 20.0, 1e-12);
  }
  EXPECT_NEAR(LeverPosition(0.0), 0.0, 1e-15);
  EXPECT_NEAR(LeverPosition(1.0), 1.0, 1e-15);
  EXPECT_TRUE(std::isfinite(LeverAngle(3.0)));
}

TEST(ValveEquationsTest, TransducerHasADeadZoneAndUnequalEnds) {
  EXPECT_DOUBLE_EQ(TransducerOutput(-1.0), -0.55);
  EXPECT_DOUBLE_EQ(TransducerOutput(1.0), 1.0);
  EXPECT_NEAR(TransducerOutput(-0.04), 0.0, 1e-15);
  EXPECT_LT(std::abs(TransducerOutput(0.4)), 0.021);
}

// Isothermal: pressure times volume is proportional to the air mass.
TEST(ValveEquationsTest, ChamberPressureIsThatOfAnIdealGas) {
  const ActuatorParameters a;
  const double mass = 0.02;
  const double charge =
      mass * 287.0 * 293.0 / (a.ambient_pressure_pa * a.chamber_volume_m3) -
      1.0;
  EXPECT_NEAR(ChamberPressure(a, charge, 0.02),
              mass * 287.0 * 293.0 / (0.0055 + 0.029 * 0.02), 1e-6);
  EXPECT_DOUBLE_EQ(ChamberPressure(a, 0.0, 0.0), a.ambient_pressure_pa);
}

TEST(ValveEquationsTest, OrificeAirFlowIsTheOddRootOfTheDrop) {
  EXPECT_DOUBLE_EQ(OrificeAirFlow(350e3, 100e3), 500.0);
  EXPECT_DOUBLE_EQ(OrificeAirFlow(100e3, 350e3), -500.0);
  EXPECT_EQ(OrificeAirFlow(2e5, 2e5), 0.0);
}

}  // namespace
}  // namespace fdi::simulator
