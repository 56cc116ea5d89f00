#include "diagnosis/observers/residual_windows.h"

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace fdi {
namespace {

TEST(ResidualWindowTest, GrowsAsThePlainMeanUntilItIsFull) {
  ResidualWindow window(4);
  double sum = 0.0;
  for (int n = 1; n <= 4; ++n) {
    EXPECT_FALSE(window.full());
    window.Push(n * n);
    sum += n * n;
    EXPECT_DOUBLE_EQ(window.mean(), sum / n);
  }
  EXPECT_TRUE(window.full());
  window.Push(100.0);
  EXPECT_DOUBLE_EQ(window.mean(), 7.5 + (100.0 - 7.5) / 4);
}

TEST(ResidualWindowTest, EnergyIsTheLogarithmOfTheDeviation) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(5.0, 2.0);
  ResidualWindow window(5000);
  for (int k = 0; k < 50000; ++k) {
    window.Push(noise(random));
  }
  EXPECT_NEAR(window.log_rms(), std::log(2.0), 0.05);
  EXPECT_NEAR(window.mean(), 5.0, 0.2);
}

TEST(ResidualWindowTest, ForgetsAtRestart) {
  ResidualWindow window(2);
  window.Push(50.0);
  window.Push(60.0);
  window.Restart();
  EXPECT_FALSE(window.full());
  window.Push(1.0);
  EXPECT_DOUBLE_EQ(window.mean(), 1.0);
}

TEST(ResidualWindowsTest, ChannelThatAbstainsKeepsItsWindow) {
  ModelSet models;
  models.channels = {{"X", Signal::kX, -1.0, 1.0, {{2, -1.0, 1.0, 0.0}}},
                     {"F", Signal::kF, -1.0, 1.0, {{2, -1.0, 1.0, 0.0}}}};
  ResidualWindows windows(models);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  windows.Push(std::array{1.0, 3.0}, 50.0);
  windows.Push(std::array{2.0, nan}, nan);
  EXPECT_TRUE(windows.window(0, 0).full());
  EXPECT_FALSE(windows.window(1, 0).full());
  EXPECT_DOUBLE_EQ(windows.window(1, 0).mean(), 3.0);
  EXPECT_FALSE(windows.command(0, 0).full());
}

TEST(ResidualWindowTest, LimitOnEnergyRisesWithTheActivityOfTheCommand) {
  WindowLimits limits{2, -1.0, 1.0, 0.3};
  limits.activity_slope = 0.5;
  const auto limit = [&](double deviation) {
    ResidualWindow command(2);
    command.Push(50.0 - deviation);
    command.Push(50.0 + deviation);
    return UpperLogRms(limits, command);
  };
  EXPECT_DOUBLE_EQ(UpperLogRms(limits, ResidualWindow(2)), 0.3);
  EXPECT_DOUBLE_EQ(limit(0.5), 0.3);
  EXPECT_DOUBLE_EQ(limit(2.0), 0.3 + 0.5 * std::log(2.0));
  EXPECT_DOUBLE_EQ(limit(100.0), 0.3 + 0.5 * std::log(4.0));
}

}  // namespace
}  // namespace fdi
