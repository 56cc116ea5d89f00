#include "planner/health_trend.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/model/student.h"

namespace fdi::planner {
namespace {

// slope per day and noise of unit deviation, correlated by `rho` from one day
// to the next; every tenth day an outlier if asked for.
std::vector<DailyValue> Drift(int days, double slope, double rho,
                              std::mt19937& random, bool outliers = false) {
  std::normal_distribution<double> normal;
  std::vector<DailyValue> values;
  double noise = normal(random);
  for (int day = 0; day < days; ++day) {
    const double odd = outliers && day % 10 == 3 ? 15.0 : 0.0;
    values.push_back({static_cast<double>(day), slope * day + noise + odd});
    noise = rho * noise + std::sqrt(1.0 - rho * rho) * normal(random);
  }
  return values;
}

struct Score {
  int given{0};      // intervals
  int contained{0};  // of these, with the truth inside
};

// The limit is where the drift arrives `ahead` days after the last value.
Score Simulate(int cases, int days, double slope, double rho, double ahead,
               unsigned seed) {
  std::mt19937 random(seed);
  Score score;
  for (int i = 0; i < cases; ++i) {
    const auto line = FitTrend(Drift(days, slope, rho, random));
    const double limit = slope * (days - 1 + ahead);
    const auto time = ToLimit(line.value(), limit, days - 1);
    if (time) {
      ++score.given;
      score.contained += time->lower <= ahead && ahead <= time->upper ? 1 : 0;
    }
  }
  return score;
}

double Share(int part, int whole) {
  return static_cast<double>(part) / whole;
}

TEST(StudentQuantileTest, AgreesWithTheTables) {
  EXPECT_NEAR(StudentQuantile(0.975, 1.0), 12.706, 0.001);
  EXPECT_NEAR(StudentQuantile(0.975, 10.0), 2.228, 0.001);
  EXPECT_NEAR(StudentQuantile(0.95, 4.0), 2.132, 0.001);
  EXPECT_NEAR(StudentQuantile(0.95, 1000.0), 1.646, 0.001);
  EXPECT_NEAR(StudentQuantile(0.05, 4.0), -2.132, 0.001);
}

// 600 drifts each; a share of 0.9 then errs by 0.012.
TEST(HealthTrendTest, NinetyPercentIntervalsContainTheTruth) {
  for (const double rho : {0.0, 0.3, 0.6}) {
    for (const int days : {30, 60, 120, 240}) {
      const double slope = 12.0 / days;
      const Score score = Simulate(600, days, slope, rho, 0.5 * days, 11);
      const double share = Share(score.contained, score.given);
      RecordProperty("contained_" + std::to_string(days) + "_days_rho_" +
                         std::to_string(rho),
                     std::to_string(share));
      EXPECT_GT(score.given, 500) << rho << ' ' << days;
      EXPECT_GE(share, 0.85) << rho << ' ' << days;
      EXPECT_LE(share, 0.95) << rho << ' ' << days;
    }
  }
}

TEST(HealthTrendTest, WithoutDriftOneInTwentyIsSignificant) {
  for (const double rho : {0.0, 0.5}) {
    std::mt19937 random(5);
    int significant = 0;
    for (int i = 0; i < 600; ++i) {
      significant += FitTrend(Drift(90, 0.0, rho, random))->significant();
    }
    EXPECT_LT(Share(significant, 600), 0.09) << rho;
    EXPECT_GT(Share(significant, 600), 0.01) << rho;
  }
}

TEST(HealthTrendTest, OddDaysDoNotTurnTheLine) {
  std::mt19937 random(7);
  double worst = 0.0;
  for (int i = 0; i < 50; ++i) {
    const auto line = FitTrend(Drift(100, 0.05, 0.0, random, true));
    worst = std::max(worst, std::abs(line->slope - 0.05));
  }
  EXPECT_LT(worst, 0.015);
}

TEST(HealthTrendTest, TimeIsCountedFromTodayAndZeroOnceTheLimitIsPassed) {
  std::mt19937 random(9);
  const auto line = FitTrend(Drift(100, -0.5, 0.0, random)).value();

  const auto ahead = ToLimit(line, -60.0, 110.0);
  ASSERT_TRUE(ahead);
  EXPECT_NEAR(ahead->days, 10.0, 1.5);
  EXPECT_LT(ahead->lower, ahead->days);
  EXPECT_GT(ahead->upper, ahead->days);
  EXPECT_EQ(ToLimit(line, -20.0, 110.0)->upper, 0.0);
  EXPECT_FALSE(ToLimit(line, 20.0, 110.0));
}

TEST(HealthTrendTest, TooFewDaysAreNoTrend) {
  std::mt19937 random(9);
  EXPECT_FALSE(FitTrend(Drift(kTrendDays - 1, 1.0, 0.0, random)));
  EXPECT_FALSE(FitTrend(std::vector<DailyValue>(20, {3.0, 1.0})));
}

TEST(HealthTrendTest, ExactLineIsExact) {
  std::vector<DailyValue> values;
  for (int day = 0; day < 10; ++day) {
    values.push_back({static_cast<double>(day), 2.0 * day});
  }
  const auto time = ToLimit(FitTrend(values).value(), 40.0, 9.0);
  ASSERT_TRUE(time);
  EXPECT_NEAR(time->days, 11.0, 1e-6);
  EXPECT_NEAR(time->upper, 11.0, 1e-6);
}

TEST(HealthTrendTest, SumsReachTheirTotalByTheirRate) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  int contained = 0;
  for (int i = 0; i < 600; ++i) {
    std::vector<DailyValue> days;
    for (int day = 0; day < 40; ++day) {
      days.push_back({static_cast<double>(day), 10.0 + normal(random)});
    }
    const auto time = ToTotal(days, 500.0).value();
    contained += time.lower <= 50.0 && 50.0 <= time.upper ? 1 : 0;
  }
  EXPECT_GE(Share(contained, 600), 0.85);
  EXPECT_LE(Share(contained, 600), 0.95);
}

}  // namespace
}  // namespace fdi::planner
