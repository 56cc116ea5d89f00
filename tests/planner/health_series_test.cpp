#include "planner/health_series.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::planner {
namespace {

using testing::HasSubstr;
using Answer = HealthForecast::Answer;

// An hour in which F is `residual` off 50 m3/h, all of it in bin `bin`.
HealthHour Hour(std::int64_t hour, double residual, int bin = 5,
                double live_share = 1.0) {
  HealthHour h;
  h.valve_id = "V1";
  h.hour = hour;
  h.model_hash = 1;
  h.seen_ms = 3'600'000;
  h.live_ms = static_cast<std::int64_t>(3.6e6 * live_share);
  h.travel = 200'000;
  h.reversals = 10;
  h.channels = {{Signal::kF, -7}};
  const auto n = static_cast<std::int64_t>(3600 * live_share);
  if (n > 0) {
    h.bins[static_cast<std::size_t>(bin)] = {
        {n, n * std::llround(residual * 128), 0,
         n * std::llround((50.0 + residual) * 128)}};
  }
  return h;
}

std::vector<HealthHour> Months(int days, double slope_per_day) {
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::vector<HealthHour> hours;
  for (int hour = 0; hour < 24 * days; ++hour) {
    hours.push_back(Hour(hour, slope_per_day * hour / 24.0 + noise(random)));
  }
  return hours;
}

TEST(HealthLimitTest, LimitsReadAsTheyAreWritten) {
  for (const char* text : {"F=-10%", "X=3", "f19=0.5", "t1=-0.25",
                           "travel=100000", "reversals=500"}) {
    EXPECT_EQ(HealthLimitText(ParseHealthLimit(text)), text);
  }
  EXPECT_EQ(ParseHealthLimit("f=-10%").signal, Signal::kF);
}

TEST(HealthLimitTest, WhatIsNoLimitIsRefusedWithWhatIs) {
  for (const char* text : {"F", "F=", "F=abc", "Q=3", "travel=-1", "f19=2",
                           "f19=5%", "F=0", "F=nan"}) {
    try {
      ParseHealthLimit(text);
      ADD_FAILURE() << text;
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), HasSubstr("F=-10%")) << text;
    }
  }
}

TEST(HealthSeriesTest, CapacityIsInPercentOfWhatIsExpected) {
  const std::vector<HealthHour> hours{Hour(0, -5.0), Hour(1, -5.0)};

  const HealthSeries series = SeriesOf(hours, ParseHealthLimit("F=-20%"));
  ASSERT_EQ(series.days.size(), 1u);
  EXPECT_NEAR(series.days[0].value, -10.0, 1e-9);
  EXPECT_NEAR(SeriesOf(hours, ParseHealthLimit("F=-9")).days[0].value, -5.0,
              1e-9);
}

TEST(HealthSeriesTest, FallingCapacityMeetsItsLimitWhenTheLineSays) {
  const HealthLimit limit = ParseHealthLimit("F=-10%");
  const HealthForecast forecast =
      Forecast(SeriesOf(Months(60, -0.05), limit), limit);

  ASSERT_EQ(forecast.answer, Answer::kTime);
  EXPECT_NEAR(*forecast.slope, -0.1, 0.005);
  EXPECT_NEAR(forecast.time->days, 100.0 - 59.5, 3.0);
  EXPECT_LT(forecast.time->lower, forecast.time->days);
  EXPECT_GT(forecast.time->upper, forecast.time->days);
}

TEST(HealthSeriesTest, NoiseIsNoTrend) {
  const HealthLimit limit = ParseHealthLimit("F=-10%");
  EXPECT_EQ(Forecast(SeriesOf(Months(60, 0.0), limit), limit).answer,
            Answer::kNoTrend);
  EXPECT_EQ(Forecast(SeriesOf(Months(5, -0.05), limit), limit).answer,
            Answer::kTooFew);
  EXPECT_EQ(Forecast(SeriesOf(Months(200, -0.05), limit), limit).answer,
            Answer::kReached);
  EXPECT_EQ(Forecast(SeriesOf(Months(60, 0.05), limit), limit).answer,
            Answer::kAway);
}

// The model errs by +2 in one bin and -2 in the other; the valve moves from one
// to the other over two months.
TEST(HealthSeriesTest, AChangeOfOperationIsNoTrend) {
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, 0.3);
  std::vector<HealthHour> hours;
  for (int day = 0; day < 60; ++day) {
    for (int hour = 0; hour < 24; ++hour) {
      const bool moved = hour < day * 24 / 60;
      hours.push_back(Hour(24 * day + hour,
                           (moved ? -2.0 : 2.0) + noise(random),
                           moved ? 3 : 6));
    }
  }
  const HealthLimit limit = ParseHealthLimit("F=-10%");
  const HealthForecast forecast = Forecast(SeriesOf(hours, limit), limit);
  EXPECT_LT(std::abs(*forecast.slope), 0.01);
}

TEST(HealthSeriesTest, MostlyUncoveredIsOutsideWhatWasTrained) {
  std::vector<HealthHour> hours;
  for (int hour = 0; hour < 24 * 30; ++hour) {
    hours.push_back(Hour(hour, 0.0, 5, hour % 24 == 0 ? 0.5 : 0.0));
  }
  const HealthLimit limit = ParseHealthLimit("F=-10%");
  const HealthForecast forecast = Forecast(SeriesOf(hours, limit), limit);
  EXPECT_EQ(forecast.answer, Answer::kOutside);
  EXPECT_EQ(ForecastText(forecast), "outside what was trained");
}

TEST(HealthSeriesTest, AnotherModelSetOrRepairBeginsAnew) {
  std::vector<HealthHour> hours = Months(20, -0.5);
  for (HealthHour hour : Months(20, 0.0)) {
    hour.hour += 24 * 20;
    hour.epoch = 1;
    hours.push_back(hour);
  }
  EXPECT_EQ(SeriesOf(hours, ParseHealthLimit("F=-10%")).days.size(), 20u);
  EXPECT_EQ(SeriesOf(hours, ParseHealthLimit("travel=5000")).days.size(), 20u);
  for (HealthHour& hour : hours) {
    hour.model_hash = hour.epoch + 7;
    hour.epoch = 0;
  }
  EXPECT_EQ(SeriesOf(hours, ParseHealthLimit("F=-10%")).days.size(), 20u);
  EXPECT_EQ(SeriesOf(hours, ParseHealthLimit("travel=5000")).days.size(), 40u);
}

TEST(HealthSeriesTest, TravelReachesItsLimitByItsRate) {
  const HealthLimit limit = ParseHealthLimit("travel=4800");
  const HealthForecast forecast =
      Forecast(SeriesOf(Months(60, 0.0), limit), limit);

  EXPECT_NEAR(*forecast.now, 60 * 48.0, 1e-6);
  EXPECT_NEAR(forecast.time->days, 40.0, 1e-6);
}

TEST(HealthSeriesTest, StrengthIsTheMeanOfTheDaysWithTheFault) {
  std::vector<HealthHour> hours;
  for (int day = 0; day < 20; ++day) {
    hours.push_back(Hour(24 * day, 0.0));
    if (day % 2 == 0) {
      hours.back().AddStrength(19, 100, 100 * 500);
    }
  }
  const HealthSeries series = SeriesOf(hours, ParseHealthLimit("f19=0.8"));
  ASSERT_EQ(series.days.size(), 10u);
  EXPECT_NEAR(series.days[3].value, 0.5, 1e-9);
}

}  // namespace
}  // namespace fdi::planner
