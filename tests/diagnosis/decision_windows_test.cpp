#include <array>

#include <gtest/gtest.h>

#include "diagnosis/clearing.h"
#include "diagnosis/isolation.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi {
namespace {

DecisionParameters TenSamples() {
  DecisionParameters parameters;
  parameters.isolation_samples = 10;
  return parameters;
}

// Pushes ten samples in which fault 0 is above T `first` times, fault 1
// `second` times.
FaultSet SupportedAfter(int first, int second) {
  IsolationWindow window(TenSamples());
  for (int k = 0; k < 10; ++k) {
    window.Push((k < first ? 1U : 0U) | (k < second ? 2U : 0U));
  }
  return window.Supported();
}

TEST(IsolationWindowTest, NeedsTkSamples) {
  IsolationWindow window(TenSamples());
  for (int k = 0; k < 9; ++k) {
    window.Push(1);
  }
  EXPECT_EQ(window.Supported(), 0U);
  window.Push(1);
  EXPECT_EQ(window.Supported(), 1U);
}

TEST(IsolationWindowTest, NinetyPerCentSupportAndThreeQuartersJoin) {
  EXPECT_EQ(SupportedAfter(9, 0), 1U);
  EXPECT_EQ(SupportedAfter(8, 0), 0U);
  EXPECT_EQ(SupportedAfter(9, 8), 3U);
  EXPECT_EQ(SupportedAfter(9, 7), 1U);
  EXPECT_EQ(SupportedAfter(8, 8), 0U);
}

TEST(IsolationWindowTest, OldSamplesLeave) {
  IsolationWindow window(TenSamples());
  for (int k = 0; k < 10; ++k) {
    window.Push(1);
  }
  for (int k = 0; k < 10; ++k) {
    window.Push(2);
  }
  EXPECT_EQ(window.Supported(), 2U);
  window.Restart();
  EXPECT_EQ(window.Supported(), 0U);
}

class ClearingWindowTest : public ::testing::Test {
 protected:
  void Push(int count, double residual, double factor, bool abnormal = false) {
    const std::array<double, 2> residuals{0.0, residual};
    for (int k = 0; k < count; ++k) {
      window_.Push(residuals, factor, abnormal);
    }
  }

  ModelSet models_ = testing::LinearPlant();  // t_c = 20, threshold 2
  ClearingWindow window_{models_};
};

TEST_F(ClearingWindowTest, ClearsAfterTcQuietSamples) {
  Push(19, 0.0, 1.0);
  EXPECT_FALSE(window_.Cleared());
  Push(1, 0.0, 1.0);
  EXPECT_TRUE(window_.Cleared());
}

TEST_F(ClearingWindowTest, AbnormalSampleStartsTheCountAnew) {
  Push(30, 0.0, 1.0);
  Push(1, 0.0, 1.0, true);
  Push(19, 0.0, 1.0);
  EXPECT_FALSE(window_.Cleared());
  Push(1, 0.0, 1.0);
  EXPECT_TRUE(window_.Cleared());
}

TEST_F(ClearingWindowTest, MeanResidualHoldsItBack) {
  Push(40, 0.61, 1.0);  // 0.3 of the threshold is 0.6
  EXPECT_FALSE(window_.Cleared());
  Push(20, 0.59, 1.0);
  EXPECT_TRUE(window_.Cleared());
}

TEST_F(ClearingWindowTest, NormalFactorHoldsItBack) {
  Push(17, 0.0, 1.0);
  Push(3, 0.0, 0.6);
  EXPECT_FALSE(window_.Cleared());
  Push(18, 0.0, 1.0);
  EXPECT_TRUE(window_.Cleared());
}

}  // namespace
}  // namespace fdi
