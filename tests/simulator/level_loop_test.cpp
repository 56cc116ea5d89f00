#include "simulator/level_loop.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "simulator/record_fit.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

LevelLoopExcitation Quiet() {
  LevelLoopExcitation config;
  config.steam_noise_t_h.sd = 0.0;
  config.pump_noise_kpa.sd = 0.0;
  config.level_noise_pct.sd = 0.0;
  return config;
}

// A valve that passes 17.34 t/h (18.1 m3/h) whatever the pressures.
double SteadyFlow(double, double) {
  return 17.34 / 0.9578;
}

TEST(LevelLoopTest, BoilerBalancesAtThePlantsOperatingPoint) {
  LevelLoop loop(Quiet(), 1.0, 1);
  for (int k = 0; k < 3600; ++k) {
    loop.Next(SteadyFlow);
  }
  EXPECT_NEAR(loop.boiler().level_pct, 49.2, 1.5);
  EXPECT_NEAR(loop.boiler().drum_pressure_pa, 2398.6e3, 2e3);
  EXPECT_NEAR(loop.boiler().steam_temperature_c, 398.8, 3.0);
  EXPECT_NEAR(loop.boiler().firing_w, 10.25e6, 0.1e6);
}

// 1 t/h too much for 100 s: 27.8 kg in a drum of 27.4 kg per %.
TEST(LevelLoopTest, LevelIntegratesTheWaterBalance) {
  LevelLoop loop(Quiet(), 1.0, 1);
  loop.Next([](double, double) { return 18.34 / 0.9578; });
  const double start = loop.boiler().level_pct;
  for (int k = 0; k < 100; ++k) {
    loop.Next([](double, double) { return 18.34 / 0.9578; });
  }
  EXPECT_NEAR(loop.boiler().level_pct - start, 100.0 / 3.6 / 27.4, 0.01);
}

TEST(LevelLoopTest, MoreLevelClosesTheValve) {
  LevelLoop loop(Quiet(), 1.0, 1);
  const double before = loop.Next(SteadyFlow).command;
  double after = 0.0;
  for (int k = 0; k < 60; ++k) {
    after = loop.Next([](double, double) { return 25.0; }).command;
  }
  EXPECT_GT(after, before + 0.02);
}

// F and the pressures that it causes are those of one and the same instant.
TEST(LevelLoopTest, FlowAndPressuresSolveEachOther) {
  LevelLoop loop(Quiet(), 1.0, 1);
  const auto flow = [](double p1, double p2) {
    return 0.6e-3 * std::sqrt(std::max(0.0, p1 - p2)) * 31.0;
  };
  const ProcessInputs inputs = loop.Next(flow);
  const double tons =
      flow(inputs.inlet_pressure_pa, inputs.outlet_pressure_pa) * 0.9578;
  EXPECT_NEAR(inputs.inlet_pressure_pa, 3557e3 - 3e3 * (tons - 17.3), 20.0);
  EXPECT_NEAR(inputs.outlet_pressure_pa,
              loop.boiler().drum_pressure_pa + 178e3 + 130.0 * tons * tons,
              20.0);
}

TEST(LevelLoopTest, ThrottledHandValveTakesPressureFromTheValve) {
  LevelLoopExcitation throttled = Quiet();
  throttled.inlet_opening = 0.2;
  const ProcessInputs open = LevelLoop(Quiet(), 1.0, 1).Next(SteadyFlow);
  const ProcessInputs shut = LevelLoop(throttled, 1.0, 1).Next(SteadyFlow);
  EXPECT_LT(shut.inlet_pressure_pa, open.inlet_pressure_pa - 5e3);
  EXPECT_DOUBLE_EQ(shut.outlet_pressure_pa, open.outlet_pressure_pa);
}

struct Moments {
  double mean{0.0};
  double sd{0.0};
};

Moments MomentsOf(Signal signal, const LevelLoopExcitation& excitation) {
  ValveSimulationConfig config;
  config.parameters = ParameterSet("lublin-actuator-3-refit");
  config.excitation = excitation;
  config.duration_s = 3000.0;
  ValveSimulation simulation(config);
  double sum = 0.0;
  double square = 0.0;
  for (int k = 0; !simulation.finished(); ++k) {
    const double value = simulation.Step().sample[signal];
    if (k >= 600) {
      sum += value / 2400.0;
      square += value * value / 2400.0;
    }
  }
  return {sum, std::sqrt(square - sum * sum)};
}

// The plant's record: CV 59.9 (sd 5.5) %, X 62.1 (4.5) %, F 17.4 (3.5) t/h,
// P1 3555 (41), P2 2617 (22) kPa.
TEST(LevelLoopTest, LoopRunsAtThePlantsOperatingPoint) {
  const LevelLoopExcitation loop;
  const Moments cv = MomentsOf(Signal::kCv, loop);
  EXPECT_NEAR(cv.mean, 59.9, 1.5);
  EXPECT_NEAR(cv.sd, 5.5, 0.8);
  const Moments x = MomentsOf(Signal::kX, loop);
  EXPECT_NEAR(x.mean, 62.1, 1.5);
  EXPECT_NEAR(x.sd, 4.5, 0.8);
  const Moments f = MomentsOf(Signal::kF, loop);
  EXPECT_NEAR(f.mean, 17.4, 0.5);
  EXPECT_NEAR(f.sd, 3.3, 0.6);
  EXPECT_NEAR(MomentsOf(Signal::kP2, loop).mean, 2617.0, 5.0);
}

// The transmitters read the pressures that act on the plug, not those to come.
TEST(LevelLoopTest, ItsRecordDrivesTheValveToTheSameAnswers) {
  ValveSimulationConfig config;
  config.excitation = LevelLoopExcitation{};
  config.duration_s = 600.0;
  config.noise = false;
  config.resolution = false;
  ValveSimulation loop(config);
  std::vector<RecordRow> rows;
  while (!loop.finished()) {
    const Sample s = loop.Step().sample;
    rows.push_back(
        {{s[Signal::kCv], s[Signal::kP1], s[Signal::kP2], s[Signal::kT1]},
         s[Signal::kX],
         s[Signal::kF]});
  }
  const RecordFit fit = FitToRecord(config.parameters, rows, 60, rows.size());
  EXPECT_LT(fit.x_rmse_pct, 0.05);
  EXPECT_LT(fit.flow_rmse, 0.05);
}

TEST(LevelLoopTest, OpenBypassLetsTheControllerCloseTheValve) {
  LevelLoopExcitation bypassed;
  bypassed.bypass_opening = 0.1;
  EXPECT_GT(MomentsOf(Signal::kX, bypassed).mean,
            MomentsOf(Signal::kX, LevelLoopExcitation{}).mean + 1.0);
}

}  // namespace
}  // namespace fdi::simulator
