#include "diagnosis/loop/oscillation.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace fdi::loop {
namespace {

constexpr double kPeriod = 37.0;

template <typename Wave>
std::vector<double> Sampled(Wave wave, double slope = 0.0) {
  std::vector<double> signal(740);
  for (std::size_t k = 0; k < signal.size(); ++k) {
    const auto t = static_cast<double>(k);
    signal[k] = 50.0 + slope * t + wave(std::fmod(t / kPeriod, 1.0));
  }
  return signal;
}
double Sine(double phase) {
  return std::sin(2.0 * std::numbers::pi * phase);
}
double Triangle(double phase) {
  return std::abs(4.0 * phase - 2.0) - 1.0;
}
double Square(double phase) {
  return phase < 0.5 ? 1.0 : -1.0;
}

TEST(OscillationTest, FindsPeriodAndRegularityOfASineOnATrend) {
  const auto found = FindOscillation(Sampled(Sine, 0.01));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->period, kPeriod, 0.3);
  EXPECT_GT(found->regularity, 5.0);
}

TEST(OscillationTest, TellsSinesFromTrianglesAndSquares) {
  const auto sine = FindOscillation(Sampled(Sine));
  const auto triangle = FindOscillation(Sampled(Triangle));
  const auto square = FindOscillation(Sampled(Square));
  ASSERT_TRUE(sine && triangle && square);
  EXPECT_LT(sine->shape, 0.2);
  EXPECT_GT(triangle->shape, 0.8);
  EXPECT_NEAR(square->shape, 0.43, 0.03);
}

TEST(OscillationTest, FindsNoneInAConstantOrARamp) {
  EXPECT_FALSE(FindOscillation(std::vector<double>(200, 3.0)));
  EXPECT_FALSE(FindOscillation(std::vector<double>{}));
  std::vector<double> bend(200);
  for (std::size_t k = 0; k < bend.size(); ++k) {
    bend[k] = k < 100 ? 0.0 : static_cast<double>(k - 100);
  }
  EXPECT_FALSE(FindOscillation(bend));
}

TEST(OscillationTest, IsNotRegularInNoise) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> noise(750);
  double colour = 0.0;
  for (double& value : noise) {
    colour = 0.9 * colour + normal(random);
    value = colour;
  }
  const auto found = FindOscillation(noise);
  EXPECT_TRUE(!found || found->regularity < 1.0) << found->regularity;
}

}  // namespace
}  // namespace fdi::loop
