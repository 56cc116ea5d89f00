#include "diagnosis/records/growth.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/time_units.h"
#include "diagnosis/model/student.h"

namespace fdi {
namespace {

constexpr double kDeviation = 0.02;

StrengthPoint Point(double hour, double strength, int fault = 3) {
  StrengthPoint p;
  p.stamp_ns = static_cast<std::int64_t>(hour * kNsPerHour);
  p.fault = fault;
  p.strength = strength;
  p.lowest = strength - 1.96 * kDeviation;
  p.highest = strength + 1.96 * kDeviation;
  p.layer = Layer::kPhysics;
  return p;
}

// At hours 0 to 4; their squared distances from the middle sum to 10.
std::vector<StrengthPoint> Hourly(const std::vector<double>& strengths) {
  std::vector<StrengthPoint> points;
  for (std::size_t hour = 0; hour < strengths.size(); ++hour) {
    points.push_back(Point(static_cast<double>(hour), strengths[hour]));
  }
  return points;
}

TEST(GrowthTest, TheRateOfALineHasTheIntervalOfItsPoints) {
  const auto growth = GrowthOf(Hourly({0.1, 0.2, 0.3, 0.4, 0.5}), 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_EQ(growth->last.strength, 0.5);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-9);
  const double half =
      24.0 * StudentQuantile(0.975, 3) * kDeviation / std::sqrt(10.0);
  EXPECT_NEAR(growth->rate->lowest, 2.4 - half, 1e-9);
  EXPECT_NEAR(growth->rate->highest, 2.4 + half, 1e-9);
  EXPECT_TRUE(growth->rate->grows());
}

// Fieller: the ends are where the line and its confidence band meet 1.
TEST(GrowthTest, TheTimeToFullEndsWhereTheBandMeetsFullStrength) {
  const auto growth = GrowthOf(Hourly({0.1, 0.2, 0.3, 0.4, 0.5}), 3);
  ASSERT_TRUE(growth && growth->full);
  EXPECT_NEAR(growth->full->seconds, 5.0 * 3600.0, 1e-6);
  const double q = StudentQuantile(0.975, 3);
  const auto band = [q](double seconds) {
    const double hours = seconds / 3600.0 + 2.0;  // From the middle.
    const double line = q * kDeviation * std::sqrt(0.2 + hours * hours / 10.0);
    return std::hypot(line, 1.96 * 0.02);
  };
  const auto line = [](double seconds) { return 0.5 + 0.1 * seconds / 3600.0; };
  const double early = growth->full->lowest;
  const double late = growth->full->highest;
  EXPECT_LT(early, growth->full->seconds);
  EXPECT_GT(late, growth->full->seconds);
  EXPECT_NEAR(line(early) + band(early), 1.0, 1e-9);
  EXPECT_NEAR(line(late) - band(late), 1.0, 1e-9);
}

TEST(GrowthTest, PointsThatScatterMakeTheIntervalWider) {
  // A line of 0.1 an hour, and deviations that are orthogonal to lines.
  const double e = 0.05;
  const auto growth = GrowthOf(
      Hourly({0.1 + 2 * e, 0.2 - e, 0.3 - 2 * e, 0.4 - e, 0.5 + 2 * e}), 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-9);
  // χ²/(n − 2) σ² = 14 e²/3, whatever σ.
  const double half = 24.0 * StudentQuantile(0.975, 3) *
                      std::sqrt(14.0 * e * e / 3.0) / std::sqrt(10.0);
  EXPECT_NEAR(growth->rate->highest - growth->rate->per_day, half, 1e-9);
}

TEST(GrowthTest, AnExactPointCountsMore) {
  auto points = Hourly({0.1, 0.2, 0.3, 0.4, 0.9});
  points[4].lowest = points[4].strength - 100.0;
  points[4].highest = points[4].strength + 100.0;
  const auto growth = GrowthOf(points, 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-4);
}

TEST(GrowthTest, OneThatFallsOrStaysHasNoTimeToFull) {
  const auto falls = GrowthOf(Hourly({0.5, 0.4, 0.3, 0.2, 0.1}), 3);
  ASSERT_TRUE(falls && falls->rate);
  EXPECT_TRUE(falls->rate->falls());
  EXPECT_FALSE(falls->full);
  const auto stays = GrowthOf(Hourly({0.5, 0.501, 0.499, 0.501, 0.5}), 3);
  ASSERT_TRUE(stays && stays->rate);
  EXPECT_FALSE(stays->rate->grows() || stays->rate->falls());
  EXPECT_FALSE(stays->full);
}

TEST(GrowthTest, ANegativeStrengthGrowsToMinusOne) {
  const auto growth = GrowthOf(Hourly({-0.1, -0.2, -0.3, -0.4, -0.5}), 3);
  ASSERT_TRUE(growth && growth->full);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-9);
  EXPECT_NEAR(growth->full->seconds, 5.0 * 3600.0, 1e-6);
}

TEST(GrowthTest, WhatIsFullDoesNotBecomeSo) {
  const auto growth = GrowthOf(Hourly({0.7, 0.8, 0.9, 1.0, 1.0}), 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_TRUE(growth->rate->grows());
  EXPECT_FALSE(growth->full);
}

TEST(GrowthTest, TakesThreePointsAndTwentyMinutes) {
  EXPECT_FALSE(GrowthOf({}, 3));
  const auto two = GrowthOf(Hourly({0.1, 0.2}), 3);
  ASSERT_TRUE(two);
  EXPECT_FALSE(two->rate);
  EXPECT_FALSE(two->full);
  const auto brief = [](double hours) {
    return GrowthOf(
        std::vector{Point(0.0, 0.1), Point(hours / 2, 0.2), Point(hours, 0.3)},
        3);
  };
  EXPECT_FALSE(brief(0.33)->rate);
  EXPECT_TRUE(brief(0.34)->rate);
}

TEST(GrowthTest, OnlyPointsOfTheFaultAndOfItsLastLayerCount) {
  auto points = Hourly({0.1, 0.2, 0.3, 0.4, 0.5});
  points.insert(points.begin() + 2, Point(1.5, 0.9, 6));
  points.insert(points.begin() + 1, Point(0.5, -0.9));
  points[1].layer = Layer::kObservers;
  const auto growth = GrowthOf(points, 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-9);
  EXPECT_FALSE(GrowthOf(points, 7));
}

// If points seven minutes apart share readings, the latest counts.
TEST(GrowthTest, PointsThatShareReadingsCountOnce) {
  auto points = Hourly({0.1, 0.2, 0.3, 0.4, 0.5});
  points.insert(points.begin() + 4, Point(4.0 - 6.9 / 60, 9.0));
  const auto growth = GrowthOf(points, 3);
  ASSERT_TRUE(growth && growth->rate);
  EXPECT_NEAR(growth->rate->per_day, 2.4, 1e-9);
}

}  // namespace
}  // namespace fdi
