#include "simulator/excitation.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::simulator {
namespace {

using testing::HasSubstr;

double NoFlow(double, double) {
  return 0.0;
}

TEST(ExcitationTest, SineIsTheBenchmarks) {
  const auto sine = MakeExcitation(SineExcitation{}, 1.0, 1);
  ProcessInputs inputs{};
  for (int k = 0; k <= 25; ++k) {
    inputs = sine->Next(NoFlow);
  }
  EXPECT_NEAR(inputs.command, 0.75, 1e-12);
  EXPECT_NEAR(inputs.inlet_pressure_pa, 3500e3, 1e-6);
  EXPECT_NEAR(inputs.outlet_pressure_pa, 2600e3 + 26e3 * std::sin(50.0), 1e-6);
  EXPECT_EQ(inputs.temperature_c, 43.0);
}

TEST(ExcitationTest, OperatingPointHasItsMeansAndDeviations) {
  const auto excitation = MakeExcitation(OperatingPointExcitation{}, 1.0, 5);
  constexpr int kCount = 100000;
  double cv = 0.0;
  double cv2 = 0.0;
  double p1 = 0.0;
  double p12 = 0.0;
  for (int k = 0; k < kCount; ++k) {
    const ProcessInputs inputs = excitation->Next(NoFlow);
    cv += 100.0 * inputs.command / kCount;
    cv2 += std::pow(100.0 * inputs.command - 71.67, 2) / kCount;
    p1 += 1e-3 * inputs.inlet_pressure_pa / kCount;
    p12 += std::pow(1e-3 * inputs.inlet_pressure_pa - 3555.0, 2) / kCount;
  }
  EXPECT_NEAR(cv, 71.67, 0.05);
  EXPECT_NEAR(std::sqrt(cv2), 0.5, 0.03);
  EXPECT_NEAR(p1, 3555.0, 1.0);
  EXPECT_NEAR(std::sqrt(p12), 22.0, 1.0);
}

TEST(ExcitationTest, SlowMovementIsASineOnTheCommand) {
  OperatingPointExcitation config;
  config.cv_noise_pct.sd = 0.0;
  config.amplitude_pct = 4.0;
  config.period_s = 40.0;
  const auto excitation = MakeExcitation(config, 1.0, 1);
  double low = 1.0;
  double high = 0.0;
  for (int k = 0; k < 40; ++k) {
    const double command = excitation->Next(NoFlow).command;
    low = std::min(low, command);
    high = std::max(high, command);
  }
  EXPECT_NEAR(high, 0.7567, 1e-6);
  EXPECT_NEAR(low, 0.6767, 1e-6);
}

TEST(ExcitationTest, RecordedRowsComeInOrderAndTheLastIsHeld) {
  const auto recorded = MakeExcitation(
      RecordedExcitation{{{50, 3500, 2600, 43}, {60, 3600, 2500, 44}}}, 1.0, 1);
  EXPECT_DOUBLE_EQ(recorded->Next(NoFlow).command, 0.5);
  EXPECT_DOUBLE_EQ(recorded->Next(NoFlow).inlet_pressure_pa, 3600e3);
  EXPECT_DOUBLE_EQ(recorded->Next(NoFlow).temperature_c, 44.0);
}

TEST(ExcitationTest, MessagesNameFieldAndRange) {
  const auto message = [](const ExcitationConfig& config) {
    try {
      Validate(config);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  OperatingPointExcitation operating_point;
  operating_point.cv_pct = 120.0;
  EXPECT_THAT(message(operating_point),
              testing::AllOf(HasSubstr("operating-point.cv_pct is 120"),
                             HasSubstr("0 to 100")));
  LevelLoopExcitation loop;
  loop.bypass_opening = 2.0;
  EXPECT_THAT(message(loop), HasSubstr("level-loop.bypass_opening is 2"));
  EXPECT_THAT(message(RecordedExcitation{}), HasSubstr("no rows"));
  EXPECT_THAT(
      message(RecordedExcitation{{{50, 3500, 2600, 43}, {50, 3500, -1, 43}}}),
      HasSubstr("csv row 2 P2 [kPa] is -1"));
  EXPECT_THROW(DefaultExcitation("noise"), ConfigError);
}

TEST(ExcitationTest, NamesLeadToTheirExcitation) {
  for (const char* name :
       {"operating-point", "sine", "level-loop", "inventory-loop", "csv"}) {
    EXPECT_EQ(ExcitationName(DefaultExcitation(name)), name);
  }
}

}  // namespace
}  // namespace fdi::simulator
