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

}  // namespace
}  // namespace fdi::simulator
