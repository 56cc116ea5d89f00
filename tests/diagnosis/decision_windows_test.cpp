#include <array>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "diagnosis/decision/episode.h"
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
  IsolationWindow window(TenSamples(), kMaxFaults);
  for (int k = 0; k < 10; ++k) {
    window.Push((k < first ? 1U : 0U) | (k < second ? 2U : 0U));
  }
  return window.Supported();
}

TEST(IsolationWindowTest, NeedsTkSamples) {
  IsolationWindow window(TenSamples(), kMaxFaults);
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
  IsolationWindow window(TenSamples(), kMaxFaults);
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

  ModelSet models_ = tests::LinearPlant();  // t_c = 20, threshold 2
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

// CV swings by 20 until a fault is detected at sample 200 and by `swing` from
// sample 300 on, where the fault is gone. @returns when it clears, 0 if never.
int ClearsAt(double swing_before, const std::function<double(int)>& cv_after) {
  ModelSet models = tests::LinearPlant();
  models.decision.clearing_samples = 60;
  ClearingWindow window(models);
  const std::array<double, 2> residuals{};
  for (int k = 0; k < 3000; ++k) {
    window.Observe(k < 300 ? 50.0 + swing_before * std::sin(0.3 * k)
                           : cv_after(k));
    if (k == 200) {
      window.Restart();
    }
    if (k >= 200) {
      window.Push(residuals, 1.0, k < 300);
    }
    if (k > 200 && window.Cleared()) {
      return k;
    }
  }
  return 0;
}

TEST(ClearingEvidenceTest, ClearsUnderTheExcitationOfTheDetection) {
  EXPECT_EQ(
      ClearsAt(20.0, [](int k) { return 50.0 + 20.0 * std::sin(0.3 * k); }),
      359);
  EXPECT_EQ(
      ClearsAt(20.0, [](int k) { return 50.0 + 12.0 * std::sin(0.3 * k); }),
      359);
}

TEST(ClearingEvidenceTest, ValveThatStandsStillDoesNotClear) {
  EXPECT_EQ(ClearsAt(20.0, [](int) { return 50.0; }), 0);
  EXPECT_EQ(ClearsAt(20.0, [](int k) { return 50.0 + std::sin(0.3 * k); }), 0);
}

TEST(ClearingEvidenceTest, SlowMoveOverTheSameRangeIsEvidence) {
  EXPECT_NEAR(ClearsAt(20.0, [](int k) { return 70.0 - 0.02 * (k - 300); }),
              300 + 2000, 5);
}

TEST(ClearingEvidenceTest, ValveThatStoodStillAtTheDetectionClears) {
  EXPECT_EQ(ClearsAt(0.0, [](int) { return 50.0; }), 359);
  EXPECT_EQ(
      ClearsAt(0.1, [](int k) { return 50.0 + 0.07 * std::sin(0.3 * k); }),
      359);
}

}  // namespace
}  // namespace fdi
