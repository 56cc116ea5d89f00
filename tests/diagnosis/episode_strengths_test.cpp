#include "diagnosis/decision/episode_strengths.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/monitor/linear_models.h"

namespace fdi {
namespace {

class EpisodeStrengthsTest : public testing::Test {
 protected:
  // Second k of an episode that was detected at 0.
  StrengthDue Step(int k, FaultSet isolated, double strength,
                   bool observed = true) {
    Verdict verdict;
    verdict.stamp_ns = k * kNsPerSecond;
    verdict.detected = true;
    verdict.strengths.fill(strength);
    if (k == 0) {
      verdict.transitions[0] = {TransitionKind::kDetected, 0, 0};
      verdict.transition_count = 1;
    }
    return strengths_.Step(verdict, isolated, observed);
  }

  EpisodeStrengths strengths_;
  ModelSet models_{monitor::LinearModels()};
};

TEST_F(EpisodeStrengthsTest, ItIsTimeAtAgesHalfAsMuchAgainEachThenHourly) {
  std::vector<int> times;
  for (int k = 0; k < 20'000; ++k) {
    if (Step(k, 0b10, 0.5) == StrengthDue::kPoint) {
      times.push_back(k);
    }
  }
  EXPECT_EQ(times, (std::vector{450, 675, 1013, 1519, 2279, 3418, 5126, 7689,
                                11'289, 14'889, 18'489}));
  Verdict over;
  over.stamp_ns = 10'000 * kNsPerSecond;
  EXPECT_EQ(strengths_.Step(over, 0b10, true), StrengthDue::kNothing);
}

TEST_F(EpisodeStrengthsTest, EveryMinuteIsTold) {
  int minutes = 0;
  for (int k = 0; k < 301; ++k) {
    minutes += Step(k, 0b10, 0.5) == StrengthDue::kMinute ? 1 : 0;
  }
  EXPECT_EQ(minutes, 5);
}

// In whole minutes 0.41 to 0.47: their mean is 0.44, their deviation
// 0.0216, Student's quantile of 6 degrees of freedom 2.447.
TEST_F(EpisodeStrengthsTest, ThePointIsTheMeanOfTheMinutes) {
  for (int k = 0; k < 8 * 60; ++k) {
    Step(k, 0b10, 0.40 + 0.01 * (k / 60) + (k % 2 == 0 ? 0.1 : -0.1));
  }
  const std::vector<StrengthPoint> points = strengths_.Observed(models_);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].fault, 7);
  EXPECT_EQ(points[0].layer, Layer::kObservers);
  EXPECT_EQ(points[0].stamp_ns, (60 + 479) * kNsPerSecond / 2);
  EXPECT_NEAR(points[0].strength, 0.44, 1e-9);
  EXPECT_NEAR(points[0].highest - 0.44, 2.447 * 0.0216 / std::sqrt(7.0), 1e-5);
  EXPECT_NEAR(0.44 - points[0].lowest, 2.447 * 0.0216 / std::sqrt(7.0), 1e-5);
}

TEST_F(EpisodeStrengthsTest, TheLastFaultThatASetCanHoldIsFollowed) {
  models_.faults.resize(kMaxFaults, 7);
  models_.faults.back() = 1;
  for (int k = 0; k < 240; ++k) {
    Step(k, FaultSet{1} << (kMaxFaults - 1), 0.5);
  }
  const std::vector<StrengthPoint> points = strengths_.Observed(models_);
  ASSERT_EQ(points.size(), 1U);
  EXPECT_EQ(points[0].fault, 1);
}

TEST_F(EpisodeStrengthsTest, AFaultCountsFromWhenItWasIsolatedByObservers) {
  for (int k = 0; k < 300; ++k) {
    Step(k, k < 200 ? 0b10 : 0b11, 0.5);
  }
  ASSERT_EQ(strengths_.Observed(models_).size(), 1U);
  EXPECT_EQ(strengths_.Observed(models_)[0].fault, 7);
  Step(300, 0b01, 0.5);
  EXPECT_TRUE(strengths_.Observed(models_).empty());
  for (int k = 301; k < 421; ++k) {
    Step(k, 0b01, 0.5);
  }
  EXPECT_EQ(strengths_.Observed(models_).size(), 1U);
  models_.faults[0] = kTravelDeviation;  // A finding has no strength.
  EXPECT_TRUE(strengths_.Observed(models_).empty());
  Step(421, 0b01, 0.5, false);
  models_.faults[0] = 1;
  EXPECT_TRUE(strengths_.Observed(models_).empty());
}

}  // namespace
}  // namespace fdi
