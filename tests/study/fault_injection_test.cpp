#include "bench/study/fault_injection.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "base/error.h"
#include "simulator/valve_equations.h"

namespace fdi::trainer::study {
namespace {

using testing::HasSubstr;

FaultInjection InjectionOf(const std::string& fault) {
  return {{simulator::ParseFaultSchedule(fault)},
          simulator::ParameterSet("lublin-actuator-3")};
}

// A reading in the middle of the plant's operation.
Sample Healthy() {
  Sample sample;
  sample.flow_unit = FlowUnit::kTPerHour;
  sample.Set(Signal::kCv, 60.0);
  sample.Set(Signal::kP1, 3550.0);
  sample.Set(Signal::kP2, 2620.0);
  sample.Set(Signal::kT1, 105.0);
  sample.Set(Signal::kX, 60.0);
  sample.Set(Signal::kF, 17.0);
  return sample;
}

Sample Faulty(const std::string& fault, const Sample& healthy = Healthy()) {
  return FaultInjector(InjectionOf(fault)).Step(healthy, 100.0).sample;
}

TEST(FaultInjectionTest, FlowSensorAndLeakageScaleTheReading) {
  EXPECT_DOUBLE_EQ(Faulty("f19:abrupt@50:strength=0.25")[Signal::kF],
                   0.75 * 17.0);
  EXPECT_DOUBLE_EQ(Faulty("f19:abrupt@50:strength=-0.25")[Signal::kF],
                   1.25 * 17.0);
  EXPECT_DOUBLE_EQ(Faulty("f5:abrupt@50:strength=0.5")[Signal::kF],
                   0.975 * 17.0);
  Sample high = Healthy();
  high.Set(Signal::kF, 35.0);
  EXPECT_DOUBLE_EQ(Faulty("f19:abrupt@50:strength=-0.5", high)[Signal::kF],
                   40.0);
}

TEST(FaultInjectionTest, TemperatureRisesToTheLimitOfItsTransmitter) {
  EXPECT_DOUBLE_EQ(Faulty("f7:abrupt@50:strength=0.25")[Signal::kT1], 200.0);
  FaultInjection wide = InjectionOf("f7:abrupt@50:strength=0.25");
  wide.valve.instruments.temperature.high = 400.0;
  EXPECT_DOUBLE_EQ(
      FaultInjector(wide).Step(Healthy(), 100.0).sample[Signal::kT1], 300.0);
  Sample cold = Healthy();
  cold.Set(Signal::kT1, 20.0);
  EXPECT_DOUBLE_EQ(FaultInjector(wide).Step(cold, 100.0).sample[Signal::kT1],
                   245.0);
  EXPECT_EQ(Faulty("f7:abrupt@50")[Signal::kF], 17.0);
}

TEST(FaultInjectionTest, OpeningFaultsMultiplyTheFlowAsTheEquationDoes) {
  // At equal pressures and temperature the flow is as f(X), here e^-3.
  const double opening = std::exp(-5.0 * 0.6);
  EXPECT_NEAR(Faulty("f6:abrupt@50:strength=0.3")[Signal::kF],
              17.0 * (opening + 0.03) / opening, 1e-9);
  // The bypass, fully open, has its own Kv; neither path is choked here.
  EXPECT_NEAR(Faulty("f18:abrupt@50:strength=0.25")[Signal::kF],
              17.0 * (120.0 * opening + 0.25 * 19.75) / (120.0 * opening),
              1e-9);
}

TEST(FaultInjectionTest, NearlyClosedValveDoesNotMultiplyNoise) {
  const auto added = [](double x_pct, double flow) {
    Sample sample = Healthy();
    sample.Set(Signal::kX, x_pct);
    sample.Set(Signal::kF, flow);
    return Faulty("f6:abrupt@50:strength=0.3", sample)[Signal::kF] - flow;
  };
  // The equation has about 0.5 t/h at 99.5 %: it is off by more than twice.
  EXPECT_NEAR(added(99.5, 2.0), added(99.5, 3.0), 1e-9);
  EXPECT_NEAR(added(100.0, 0.0), added(100.0, 0.05), 1e-9);
  EXPECT_GT(added(100.0, 0.0), 5.0);
}

TEST(FaultInjectionTest, TransmittersStepByAShareOfTheirSpanOrStandStill) {
  EXPECT_DOUBLE_EQ(Faulty("t1:abrupt@50:strength=-0.25")[Signal::kT1], 55.0);
  EXPECT_DOUBLE_EQ(Faulty("p1:abrupt@50:strength=0.1")[Signal::kP1], 3950.0);
  EXPECT_DOUBLE_EQ(Faulty("p2:abrupt@50:strength=0.9")[Signal::kP2], 4000.0);
  FaultInjector injector(InjectionOf("t1:flatline@50"));
  Sample sample = Healthy();
  EXPECT_EQ(injector.Step(sample, 49.0).sample[Signal::kT1], 105.0);
  sample.Set(Signal::kT1, 106.0);
  EXPECT_EQ(injector.Step(sample, 50.0).sample[Signal::kT1], 106.0);
  sample.Set(Signal::kT1, 107.0);
  EXPECT_EQ(injector.Step(sample, 51.0).sample[Signal::kT1], 106.0);
}

TEST(FaultInjectionTest, TruthFollowsTheScheduleAndNothingChangesBefore) {
  FaultInjector injector(InjectionOf("f19:incipient@50+100:strength=0.4"));
  const LabelledSample before = injector.Step(Healthy(), 49.0);
  EXPECT_EQ(before.sample.values, Healthy().values);
  EXPECT_EQ(before.truth->strength, 0.0);
  const LabelledSample half = injector.Step(Healthy(), 100.0);
  EXPECT_EQ(half.truth->fault, 19);
  EXPECT_DOUBLE_EQ(half.truth->strength, 0.2);
  EXPECT_DOUBLE_EQ(half.sample[Signal::kF], 0.8 * 17.0);
}

TEST(FaultInjectionTest, ReadingsThatAreMissingStayMissing) {
  Sample sample = Healthy();
  sample.Set(Signal::kX, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(Faulty("f6:abrupt@50", sample)[Signal::kF], 17.0);
  EXPECT_EQ(SignalsFor(InjectionOf("f19:abrupt@50")), MaskOf(Signal::kF));
}

TEST(FaultInjectionTest, FaultsThatMoveTheRodAreRefusedByName) {
  try {
    FaultInjector injector(InjectionOf("f10:abrupt@50"));
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_THAT(error.what(), HasSubstr("f10"));
    EXPECT_THAT(error.what(), HasSubstr("f5 f6 f7 f18 f19 t1 p1 p2"));
  }
}

}  // namespace
}  // namespace fdi::trainer::study
