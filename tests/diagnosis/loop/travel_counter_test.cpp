#include "diagnosis/loop/travel_counter.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace fdi::loop {
namespace {

TEST(TravelCounterTest, CountsATriangleWave) {
  // Four strokes of 20 % in steps of 0.5 %: 40..60..40..60..40.
  TravelCounter counter;
  for (int k = 0; k <= 160; ++k) {
    const int phase = k % 80;
    const double x = 40.0 + 0.5 * (phase <= 40 ? phase : 80 - phase);
    counter.Push(x, x, k < 80, 2.0);
  }
  const TravelCounts& counts = counter.counts();
  EXPECT_DOUBLE_EQ(counts.time_s, 322.0);
  EXPECT_DOUBLE_EQ(counts.auto_s, 160.0);
  EXPECT_DOUBLE_EQ(counts.travel, 80.0);
  // Three turns, each of which costs at most a dead band.
  EXPECT_NEAR(counts.dead_band_travel, 80.0, 5.0);
  EXPECT_EQ(counts.reversals, 3);
  EXPECT_EQ(counts.slip_jumps, 0);
}

TEST(TravelCounterTest, DoesNotCountNoiseInTheDeadBand) {
  TravelCounter counter;
  for (int k = 0; k < 1000; ++k) {
    counter.Push(50.0, k % 2 == 0 ? 49.8 : 50.2, true, 1.0);
  }
  EXPECT_NEAR(counter.counts().travel, 0.4 * 999, 1e-9);
  EXPECT_EQ(counter.counts().dead_band_travel, 0.0);
  EXPECT_EQ(counter.counts().reversals, 0);
}

TEST(TravelCounterTest, CountsJumpsOfThePositionAlone) {
  TravelCounter counter;
  counter.Push(50.0, 48.0, true, 1.0);
  counter.Push(50.1, 50.0, true, 1.0);  // Slips.
  counter.Push(55.0, 54.0, true, 1.0);  // Follows.
  EXPECT_EQ(counter.counts().slip_jumps, 1);
  EXPECT_DOUBLE_EQ(counter.counts().largest_jump, 2.0);
}

TEST(TravelCounterTest, CountsTimeAtTheEnds) {
  TravelCounter counter;
  for (const double x : {0.0, 1.0, 1.1, 50.0, 98.9, 99.0, 100.0, 101.0}) {
    counter.Push(x, x, true, 1.0);
  }
  EXPECT_DOUBLE_EQ(counter.counts().low_end_s, 2.0);
  EXPECT_DOUBLE_EQ(counter.counts().high_end_s, 3.0);
}

TEST(TravelCounterTest, DoesNotCountAcrossARestart) {
  TravelCounter counter;
  counter.Push(20.0, 20.0, true, 1.0);
  counter.Restart();
  counter.Push(80.0, 80.0, true, 1.0);
  EXPECT_EQ(counter.counts().travel, 0.0);
  EXPECT_EQ(counter.counts().dead_band_travel, 0.0);
}

TEST(TravelCounterTest, RefusesWhatIsNoSample) {
  TravelCounter counter;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(counter.Push(nan, 1.0, true, 1.0), std::invalid_argument);
  EXPECT_THROW(counter.Push(1.0, 1.0, true, 0.0), std::invalid_argument);
}

// x = gain (1 - e^(-t/T)), or with an overshoot of a second-order system.
TEST(StepFinderTest, MeasuresAFirstOrderLag) {
  StepFinder finder(2.0, 30.0);
  std::optional<StepResponse> found;
  constexpr double kLag_s = 4.0;
  for (int k = -400; k <= 400; ++k) {
    const double t = 0.1 * k;
    const double cv = t < 0.0 ? 40.0 : 50.0;
    const double x =
        40.0 + (t < 0.0 ? 0.0 : 9.0 * (1.0 - std::exp(-t / kLag_s)));
    if (const auto response = finder.Push(cv, x, 0.1)) {
      EXPECT_FALSE(found);
      found = response;
    }
  }
  EXPECT_FALSE(found);  // 30 s of 0.1 s are more than it keeps.
  StepFinder coarse(2.0, 30.0);
  for (int k = -80; k <= 80; ++k) {
    const double t = 0.5 * k;
    const double cv = t < 0.0 ? 40.0 : 50.0;
    const double x =
        40.0 + (t < 0.0 ? 0.0 : 9.0 * (1.0 - std::exp(-t / kLag_s)));
    if (const auto response = coarse.Push(cv, x, 0.5)) {
      EXPECT_FALSE(found);
      found = response;
    }
  }
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->size, 10.0);
  EXPECT_NEAR(found->gain, 0.9, 0.01);
  EXPECT_NEAR(found->t63_s, kLag_s * -std::log(1.0 - 0.63), 0.5);
  EXPECT_NEAR(found->t86_s, kLag_s * -std::log(1.0 - 0.865), 0.5);
  EXPECT_NEAR(found->overshoot, 0.0, 0.5);
}

TEST(StepFinderTest, MeasuresAnOvershoot) {
  // Damping 0.5: overshoot exp(-π 0.5 / sqrt(0.75)) = 16.3 %.
  StepFinder finder(2.0, 40.0);
  std::optional<StepResponse> found;
  for (int k = -200; k <= 170; ++k) {
    const double t = 0.25 * k;
    const double cv = t < 0.0 ? 60.0 : 55.0;
    const double w = std::sqrt(0.75);
    const double rise = 1.0 - std::exp(-0.5 * t) *
                                  (std::cos(w * t) + 0.5 / w * std::sin(w * t));
    const double x = 60.0 - (t < 0.0 ? 0.0 : 5.0 * rise);
    if (const auto response = finder.Push(cv, x, 0.25)) {
      found = response;
    }
  }
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->size, -5.0);
  EXPECT_NEAR(found->overshoot, 16.3, 0.5);
}

TEST(StepFinderTest, FindsNoStepInARamp) {
  StepFinder finder(2.0, 10.0);
  for (int k = 0; k < 500; ++k) {
    const double cv = 20.0 + 0.1 * k;
    EXPECT_FALSE(finder.Push(cv, cv, 1.0));
  }
}

}  // namespace
}  // namespace fdi::loop
