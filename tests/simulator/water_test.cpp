#include <gtest/gtest.h>

#include "simulator/valve_equations.h"

namespace fdi::simulator {
namespace {

// Steam tables, saturated liquid.
TEST(WaterTest, DensityFollowsTheSteamTables) {
  EXPECT_NEAR(WaterDensity(20.0), 998.2, 1.0);
  EXPECT_NEAR(WaterDensity(43.0), 991.0, 1.0);
  EXPECT_NEAR(WaterDensity(100.7), 957.8, 1.0);
  EXPECT_NEAR(WaterDensity(200.0), 864.7, 1.0);
  EXPECT_NEAR(WaterDensity(300.0), 712.1, 1.5);
}

TEST(WaterTest, FlowingLiquidKeepsItsDensityBeyondBoiling) {
  EXPECT_EQ(LiquidDensity(43.0), WaterDensity(43.0));
  EXPECT_EQ(LiquidDensity(100.7), WaterDensity(100.7));
  EXPECT_NEAR(LiquidDensity(268.0), 951.0, 1.0);
}

TEST(WaterTest, VapourPressureFollowsTheSteamTables) {
  EXPECT_NEAR(VapourPressure(200.0), 1.555e6, 0.01e6);
  EXPECT_NEAR(VapourPressure(100.0), 101.3e3, 7e3);
  EXPECT_LT(VapourPressure(43.0), 12e3);
}

}  // namespace
}  // namespace fdi::simulator
