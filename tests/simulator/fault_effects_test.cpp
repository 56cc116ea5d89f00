#include "simulator/fault_effects.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "diagnosis/fault_catalogue.h"

namespace fdi::simulator {
namespace {

TEST(FaultEffectsTest, StrengthZeroLeavesTheValveHealthy) {
  FaultEffects effects;
  for (int fault = 1; fault <= kLastFault; ++fault) {
    ApplyFault(fault, 0.0, effects);
  }
  EXPECT_EQ(effects, FaultEffects{});
}

TEST(FaultEffectsTest, EveryFaultChangesSomething) {
  for (int fault = 1; fault <= kLastFault; ++fault) {
    FaultEffects effects;
    ApplyFault(fault, 0.5, effects);
    EXPECT_NE(effects, FaultEffects{}) << FaultName(fault);
  }
}

TEST(FaultEffectsTest, FaultsCombine) {
  FaultEffects effects;
  ApplyFault(1, 0.5, effects);
  ApplyFault(2, 1.0, effects);
  ApplyFault(19, 0.25, effects);
  EXPECT_DOUBLE_EQ(effects.upper_stop_factor, 0.5 * 0.8);
  EXPECT_DOUBLE_EQ(effects.kv_factor, 0.8);
  EXPECT_DOUBLE_EQ(effects.flow_reading_factor, 0.75);
}

TEST(FaultEffectsTest, SignOfPressureFaultChoosesTheSide) {
  FaultEffects positive;
  ApplyFault(17, 0.5, positive);
  EXPECT_DOUBLE_EQ(positive.outlet_factor, 0.5);
  EXPECT_DOUBLE_EQ(positive.inlet_factor, 1.0);
  FaultEffects negative;
  ApplyFault(17, -0.5, negative);
  EXPECT_DOUBLE_EQ(negative.inlet_factor, 0.5);
  EXPECT_DOUBLE_EQ(negative.outlet_factor, 1.0);
}

TEST(FaultEffectsTest, RefusesUnknownFaultsAndStrengths) {
  FaultEffects effects;
  EXPECT_THROW(ApplyFault(0, 0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(kLastFault + 1, 0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(1, -0.5, effects), std::invalid_argument);
  EXPECT_THROW(ApplyFault(19, 1.5, effects), std::invalid_argument);
}

}  // namespace
}  // namespace fdi::simulator
