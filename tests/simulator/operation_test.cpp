#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "simulator/valve_simulation.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

std::vector<Sample> RunOf(const ValveSimulationConfig& config) {
  ValveSimulation simulation(config);
  std::vector<Sample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step().sample);
  }
  return samples;
}

ValveSimulationConfig Quiet(const ExcitationConfig& excitation,
                            double duration_s) {
  ValveSimulationConfig config;
  config.excitation = excitation;
  config.duration_s = duration_s;
  config.noise = false;
  config.resolution = false;
  return config;
}

TEST(OperationTest, AProfileIsLinearBetweenItsPointsAndEndsWithThem) {
  ValveSimulationConfig config = Quiet(SineExcitation{}, 60.0);
  const auto plain = RunOf(config);
  InputProfile profile;
  profile.t_s = {10.0, 30.0, 30.0, 40.0};
  profile.cv_pct = {100.0, 60.0, 20.0, 20.0};
  profile.t1_degc = {20.0, 40.0, 40.0, 80.0};
  config.inputs = {profile};
  const auto profiled = RunOf(config);

  for (const std::size_t k : {0U, 9U, 41U, 59U}) {
    EXPECT_EQ(profiled[k][Signal::kCv], plain[k][Signal::kCv]) << k;
    EXPECT_EQ(profiled[k][Signal::kT1], plain[k][Signal::kT1]) << k;
  }
  EXPECT_NEAR(profiled[10][Signal::kCv], 100.0, 1e-9);
  EXPECT_NEAR(profiled[15][Signal::kCv], 90.0, 1e-9);
  EXPECT_NEAR(profiled[29][Signal::kCv], 62.0, 1e-9);
  EXPECT_NEAR(profiled[30][Signal::kCv], 20.0, 1e-9);
  EXPECT_NEAR(profiled[40][Signal::kCv], 20.0, 1e-9);
  EXPECT_NEAR(profiled[20][Signal::kT1], 30.0, 1e-9);
  EXPECT_NEAR(profiled[35][Signal::kT1], 60.0, 1e-9);
  for (std::size_t k = 0; k < plain.size(); ++k) {  // Not profiled.
    EXPECT_EQ(profiled[k][Signal::kP1], plain[k][Signal::kP1]);
  }
}

// Ten minutes fully open would fill the drum by far and wind the controller up.
TEST(OperationTest, AClosedLoopIsHeldWhileItsCommandIsProfiled) {
  ValveSimulationConfig config = Quiet(LevelLoopExcitation{}, 1200.0);
  InputProfile open;
  open.t_s = {300.0, 900.0};
  open.cv_pct = {0.0, 0.0};
  config.inputs = {open};
  const auto samples = RunOf(config);

  EXPECT_GT(samples[600][Signal::kF], 30.0);
  EXPECT_LT(samples[600][Signal::kP1], samples[299][Signal::kP1] - 30.0);
  EXPECT_GT(samples[600][Signal::kP2], samples[299][Signal::kP2] + 100.0);
  EXPECT_NEAR(samples[901][Signal::kCv], samples[299][Signal::kCv], 8.0);
}

TEST(OperationTest, AShutValveWithoutPressureAcrossPassesNothing) {
  ValveSimulationConfig config = Quiet(LevelLoopExcitation{}, 60.0);
  InputProfile parked;
  parked.t_s = {0.0, 60.0};
  parked.cv_pct = {100.0, 100.0};
  parked.p1_kpa = {2600.0, 2600.0};
  parked.p2_kpa = {2600.0, 2600.0};
  config.inputs = {parked};
  for (const Sample& sample : RunOf(config)) {
    EXPECT_NEAR(sample[Signal::kX], 100.0, 0.5);
    EXPECT_EQ(sample[Signal::kF], 0.0);
    EXPECT_EQ(sample[Signal::kP1], sample[Signal::kP2]);
  }
}

TEST(OperationTest, NoiseFollowsTheSeedAndSparesAShutValve) {
  ValveSimulationConfig config = Quiet(OperatingPointExcitation{}, 2000.0);
  InputProfile profile;
  profile.t_s = {0.0, 1000.0, 1000.0, 2000.0};
  profile.cv_pct = {60.0, 60.0, 100.0, 100.0};
  profile.cv_noise_pct = {2.0, 0.5};
  config.inputs = {profile};
  const auto samples = RunOf(config);
  const auto same = RunOf(config);
  config.seed = 2;
  const auto other = RunOf(config);

  double sum = 0.0;
  for (std::size_t k = 0; k < 1000; ++k) {
    const double noise = samples[k][Signal::kCv] - 60.0;
    sum += noise * noise;
    EXPECT_EQ(samples[k][Signal::kCv], same[k][Signal::kCv]);
    EXPECT_EQ(samples[k + 1000][Signal::kCv], 100.0);
  }
  EXPECT_NEAR(sum / 1000.0, 4.0, 1.0);  // sd of the estimate about 0.23
  EXPECT_NE(samples[5][Signal::kCv], other[5][Signal::kCv]);
}

TEST(OperationTest, ModesAreThoseOfTheirStretchElseOfTheRecord) {
  RecordedExcitation recorded;
  for (int k = 0; k < 30; ++k) {
    recorded.rows.push_back(
        {60.0, 3500.0, 2600.0, 100.0,
         k < 10 ? ValveMode::kCalibrating : ValveMode::kAuto});
  }
  ValveSimulationConfig config = Quiet(recorded, 30.0);
  config.modes = {{5.0, 8.0, ValveMode::kManual},
                  {20.0, 25.0, ValveMode::kInhibited}};
  const auto samples = RunOf(config);
  EXPECT_EQ(samples[4].mode, ValveMode::kCalibrating);
  EXPECT_EQ(samples[5].mode, ValveMode::kManual);
  EXPECT_EQ(samples[8].mode, ValveMode::kCalibrating);
  EXPECT_EQ(samples[10].mode, ValveMode::kAuto);
  EXPECT_EQ(samples[24].mode, ValveMode::kInhibited);
  EXPECT_EQ(samples[25].mode, ValveMode::kAuto);
}

std::string RefusalOf(const InputProfile& profile) {
  try {
    Validate(profile);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(OperationTest, RefusalsNameTheField) {
  InputProfile profile;
  profile.t_s = {0.0, 10.0};
  EXPECT_THAT(RefusalOf(profile), HasSubstr("one of cv_pct, p1_kpa"));
  profile.cv_pct = {50.0};
  EXPECT_THAT(RefusalOf(profile), HasSubstr("cv_pct has 1 values, t_s has 2"));
  profile.cv_pct = {50.0, 101.0};
  EXPECT_THAT(RefusalOf(profile), HasSubstr("input.cv_pct"));
  profile.cv_pct = {50.0, 60.0};
  EXPECT_EQ(RefusalOf(profile), "accepted");
  profile.t_s = {10.0, 0.0};
  EXPECT_THAT(RefusalOf(profile), HasSubstr("t_s does not ascend"));
  profile.t_s = {10.0};
  EXPECT_THAT(RefusalOf(profile), HasSubstr("at least 2"));
  EXPECT_THROW(Validate(ModeStretch{5.0, 5.0, ValveMode::kManual}),
               ConfigError);
  ValveSimulationConfig config = Quiet(SineExcitation{}, 10.0);
  config.continuous_inputs = true;
  config.inputs.emplace_back().t_s = {0.0, 1.0};
  config.inputs[0].cv_pct = {0.0, 1.0};
  EXPECT_THROW(Validate(config), ConfigError);
}

}  // namespace
}  // namespace fdi::simulator
