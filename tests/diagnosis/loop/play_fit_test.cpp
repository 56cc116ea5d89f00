#include "diagnosis/loop/play_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/loop/play.h"

namespace fdi::loop {
namespace {

std::vector<double> Wave(std::size_t samples) {
  std::vector<double> wave(samples);
  for (std::size_t k = 0; k < samples; ++k) {
    const auto t = static_cast<double>(k);
    wave[k] = 50.0 + 5.0 * std::sin(2.0 * std::numbers::pi * t / 97.0) +
              2.0 * std::sin(2.0 * std::numbers::pi * t / 41.0);
  }
  return wave;
}

std::vector<double> Scaled(std::vector<double> values, double slope) {
  for (double& value : values) {
    value = 3.0 + slope * value;
  }
  return values;
}

TEST(PlayTest, StandsWithinItsWidthAndFollowsBeyond) {
  const std::vector<double> input{0.0, 1.0, 3.0, 2.0, 1.0, -1.0};
  const std::vector<double> expected{0.0, 0.0, 2.0, 2.0, 2.0, 0.0};
  EXPECT_EQ(PlayOf(input, 2.0, 0.0), expected);
}

TEST(PlayTest, StartsWhereItIsTold) {
  const std::vector<double> input{0.0, 0.5, -0.5};
  EXPECT_EQ(PlayOf(input, 2.0, 1.0), (std::vector<double>{1.0, 1.0, 0.5}));
}

TEST(PlayFitTest, FindsTheBandOfAPlay) {
  const std::vector<double> op = Wave(600);
  const auto [low, high] = std::ranges::minmax_element(op);
  const double grid = 0.86 / 23.0 * (*high - *low);
  for (const double band : {2.0, 4.0, 6.0}) {
    const std::vector<double> pv = Scaled(PlayOf(op, band, op[0]), 1.5);
    const auto fit = FitPlay(op, pv, 1);
    ASSERT_TRUE(fit);
    EXPECT_NEAR(fit->band, band, grid);
    EXPECT_LE(fit->band_low, fit->band);
    EXPECT_GE(fit->band_high, fit->band);
    EXPECT_GT(fit->play, 0.99);
    EXPECT_GT(fit->explained(), 0.7);
    EXPECT_NEAR(fit->slope, 1.5, 0.1);
  }
}

TEST(PlayFitTest, FindsAPlayThatBeginsAtEitherSide) {
  const std::vector<double> op = Wave(300);
  for (const double side : {-2.0, 0.0, 2.0}) {
    const auto fit = FitPlay(op, PlayOf(op, 4.0, op[0] + side), 1);
    ASSERT_TRUE(fit);
    EXPECT_GT(fit->play, 0.98) << side;
  }
}

TEST(PlayFitTest, ExplainsNothingMoreWhereThereIsNoPlay) {
  const std::vector<double> op = Wave(600);
  const auto fit = FitPlay(op, Scaled(op, -0.7), -1);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit->linear, 1.0, 1e-9);
  EXPECT_LE(fit->gap(), 0.0);
}

TEST(PlayFitTest, ExplainsNothingWithTheWrongSign) {
  const std::vector<double> op = Wave(600);
  const auto fit = FitPlay(op, Scaled(op, -0.7), 1);
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->linear, 0.1);
}

TEST(PlayFitTest, RefusesSignalsThatStandStill) {
  const std::vector<double> op = Wave(100);
  EXPECT_FALSE(FitPlay(op, std::vector<double>(100, 4.0), 1));
  EXPECT_FALSE(FitPlay(std::vector<double>(100, 4.0), op, 1));
  EXPECT_FALSE(FitPlay({}, {}, 1));
}

TEST(PlayPredictionGainTest, IsLargeForAPlayAndSmallWithout) {
  const std::vector<double> op = Wave(400);
  const std::vector<double> play = PlayOf(op, 5.0, op[0]);
  std::vector<double> with(op.size(), 50.0);
  std::vector<double> without(op.size(), 50.0);
  for (std::size_t k = 1; k < op.size(); ++k) {
    const double noise = 0.2 * std::sin(1e4 * static_cast<double>(k * k));
    with[k] = 0.7 * with[k - 1] + 0.3 * play[k - 1] + noise;
    without[k] = 0.7 * without[k - 1] + 0.3 * op[k - 1] + noise;
  }
  PlayFit fit;
  fit.band_low = 4.8;
  fit.band_high = 5.2;
  fit.step = 0.3;
  EXPECT_GT(PlayPredictionGain(op, with, fit), 50.0);
  EXPECT_LT(PlayPredictionGain(op, without, fit), 3.0);
  // A play of another width is no witness.
  fit.band_low = 14.0;
  fit.band_high = 15.0;
  EXPECT_LT(PlayPredictionGain(op, with, fit), 0.0);
}

TEST(IncrementFitTest, ExplainsAnIntegral) {
  const std::vector<double> op = Wave(600);
  std::vector<double> pv(op.size(), 0.0);
  for (std::size_t k = 1; k < pv.size(); ++k) {
    pv[k] = pv[k - 1] + 0.02 * (op[k - 1] - 50.0);
  }
  EXPECT_GT(FitIncrements(op, pv, 1), 0.95);
  EXPECT_LT(FitIncrements(op, PlayOf(op, 5.0, op[0]), 1), 0.3);
}

}  // namespace
}  // namespace fdi::loop
