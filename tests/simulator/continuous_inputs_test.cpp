#include <algorithm>

#include <gtest/gtest.h>

#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

// Samples twenty times as dense come close to inputs that never stand still;
// the solver restarts at the faults and stops only.
TEST(ContinuousInputsTest, AreTheLimitOfDenseSamples) {
  ValveSimulationConfig config;
  config.excitation = SineExcitation{};
  config.faults = {ParseFaultSchedule("f12:abrupt@50.5:strength=0.3")};
  config.duration_s = 200.0;
  config.noise = false;
  config.resolution = false;
  config.continuous_inputs = true;
  ValveSimulation continuous(config);
  config.continuous_inputs = false;
  config.period_s = 0.05;
  ValveSimulation dense(config);
  for (int k = 0; k < 4000; ++k) {
    const Sample sampled = dense.Step().sample;
    if (k % 20 == 0) {
      const Sample sample = continuous.Step().sample;
      EXPECT_NEAR(sample[Signal::kX], sampled[Signal::kX], 0.3) << k;
      EXPECT_EQ(sample[Signal::kCv], sampled[Signal::kCv]);
    }
  }
  EXPECT_LT(continuous.statistics().restarts, 10);
  EXPECT_LT(continuous.statistics().solver_steps, 200 * 35);
}

// A command that rises by 2 % in each sample is the ramp of 20 % in ten.
TEST(ContinuousInputsTest, RecordedInputsAreLinearBetweenTheirSamples) {
  ValveSimulationConfig config;
  RecordedExcitation fine;
  RecordedExcitation coarse;
  for (int k = 0; k <= 200; ++k) {
    const double cv = 40.0 + (k % 20 < 10 ? k % 20 : 20 - k % 20) * 2.0;
    fine.rows.push_back({cv, 3500.0, 2600.0, 43.0});
    if (k % 10 == 0) {
      coarse.rows.push_back(fine.rows.back());
    }
  }
  config.noise = false;
  config.resolution = false;
  config.continuous_inputs = true;
  config.duration_s = 200.0;
  config.excitation = fine;
  ValveSimulation fine_run(config);
  config.excitation = coarse;
  config.period_s = 10.0;
  ValveSimulation coarse_run(config);
  double moved = 0.0;
  for (int k = 0; k < 200; ++k) {
    const Sample sample = fine_run.Step().sample;
    if (k % 10 == 0) {
      const double x = coarse_run.Step().sample[Signal::kX];
      EXPECT_NEAR(sample[Signal::kX], x, 0.02) << k;
      moved = std::max(moved, x);
    }
  }
  EXPECT_GT(moved, 50.0);
}

}  // namespace
}  // namespace fdi::simulator
