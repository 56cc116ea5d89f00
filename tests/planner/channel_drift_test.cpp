#include "planner/channel_drift.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fdi::planner {
namespace {

constexpr double kDeviation = 0.4;  // of the single residual of X

// X is off by what `residual` says of the hour, and by slow noise; the command
// is now here, now there, where the model has another bias.
std::vector<HealthHour> Hours(int count,
                              const std::function<double(int)>& residual) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 0.03);
  std::vector<HealthHour> hours;
  for (int i = 0; i < count; ++i) {
    HealthHour hour;
    hour.valve_id = "V1";
    hour.hour = 490'000 + i;
    hour.model_hash = 1;
    hour.live_ms = hour.seen_ms = 3'600'000;
    hour.channels = {{Signal::kX, -10}};
    const std::size_t bin = random() % 2 == 0 ? 4 : 7;
    const double mean = residual(i) + noise(random) + (bin == 4 ? 0.1 : -0.1);
    const double unit = 1024.0;
    hour.bins[bin] = {
        {3600, std::llround(3600 * mean * unit),
         std::llround(3600 * (mean * mean + kDeviation * kDeviation) * unit *
                      unit),
         std::llround(3600 * 50.0 * unit)}};
    hours.push_back(std::move(hour));
  }
  return hours;
}

TEST(ChannelDriftTest, IsSaidWithSizeAndPace) {
  const auto drifts = DriftsOf(
      Hours(100, [](int i) { return i < 70 ? 0.0 : 0.05 * (i - 70); }));
  ASSERT_EQ(drifts.size(), 1U);
  EXPECT_EQ(drifts[0].signal, Signal::kX);
  EXPECT_NEAR(drifts[0].now, 1.45, 0.1);
  EXPECT_NEAR(drifts[0].per_hour, 0.05, 0.005);
  EXPECT_NEAR(static_cast<double>(drifts[0].since_ns) / 3.6e12, 490'073, 5);
  EXPECT_THAT(DriftText(drifts[0]),
              testing::AllOf(testing::StartsWith("X reads 1."),
                             testing::HasSubstr(" % above its model since 20"),
                             testing::HasSubstr(", growing by 0.05")));
}

TEST(ChannelDriftTest, AWeekOfSlowGrowthIsOneToo) {
  const auto drifts = DriftsOf(Hours(240, [](int i) { return -0.003 * i; }));
  ASSERT_EQ(drifts.size(), 1U);
  EXPECT_NEAR(drifts[0].per_hour, -0.003, 0.0005);
  EXPECT_NEAR(drifts[0].now, -0.72, 0.1);
}

TEST(ChannelDriftTest, WhatIsNoDrift) {
  const auto drifts = [](int hours, const std::function<double(int)>& of) {
    return DriftsOf(Hours(hours, of)).size();
  };
  EXPECT_EQ(drifts(200, [](int) { return 0.0; }), 0U);
  // A step is an abrupt fault; a day has its cycle.
  EXPECT_EQ(drifts(200, [](int i) { return i < 185 ? 0.0 : 2.0; }), 0U);
  for (int begin = 0; begin < 24; begin += 3) {
    EXPECT_EQ(
        drifts(48,
               [begin](int i) {
                 return std::sin(2 * std::numbers::pi * (i + begin) / 24.0);
               }),
        0U)
        << begin;
  }
  EXPECT_EQ(drifts(15, [](int i) { return 0.1 * i; }), 0U);    // Too short.
  EXPECT_EQ(drifts(40, [](int i) { return 0.004 * i; }), 0U);  // Too small.
  // Back to the model.
  EXPECT_EQ(drifts(24, [](int i) { return 3.0 - 0.1 * i; }), 0U);
}

}  // namespace
}  // namespace fdi::planner
