#include "diagnosis/decision/alarm_budget.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi {
namespace {

using testing::HasSubstr;

// Hours whose shares are 0.4 + 0.1 times an exponential variable.
HealthyHours Valve(const std::string& id, int hours, int days,
                   std::mt19937& random) {
  std::exponential_distribution<double> tail(10.0);
  HealthyHours valve;
  valve.valve_id = id;
  valve.days = days;
  for (int i = 0; i < hours; ++i) {
    valve.hours.push_back({i, 0.4 + tail(random)});
  }
  return valve;
}

std::vector<HealthyHours> Fleet(int valves, int hours, int days = 30) {
  std::mt19937 random(1);
  std::vector<HealthyHours> fleet;
  for (int v = 0; v < valves; ++v) {
    fleet.push_back(Valve("V" + std::to_string(v), hours, days, random));
  }
  return fleet;
}

TEST(AlarmBudgetTest, ABudgetIsANumberOfAlarmsInAPeriod) {
  EXPECT_EQ(ParseAlarmBudget("1/day"), 24.0);
  EXPECT_EQ(ParseAlarmBudget("2/week"), 84.0);
  EXPECT_EQ(ParseAlarmBudget("0.5/month"), 1461.0);
  EXPECT_EQ(ParseAlarmBudget("1/year"), 8766.0);
  for (const char* text :
       {"", "1", "/day", "1/hour", "0/day", "-1/day", "nan/day", "inf/day",
        "1 /day", "1/day ", "1/week/day"}) {
    EXPECT_THROW(ParseAlarmBudget(text), ConfigError) << text;
  }
}

// exp(-(z - 0.4)/0.1) of the hours exceed z: once in 1000 h 0.4 + 0.1 ln 1000.
TEST(ShareTailsTest, ReturnPeriodsAreThoseOfTheHours) {
  const ShareTails tails(Fleet(20, 300));
  ASSERT_EQ(tails.valves(), 20U);
  EXPECT_EQ(tails.pooled_hours(), 6000.0);
  EXPECT_EQ(tails.longest_hours(), 60'000.0);
  for (const double hours : {1e3, 1e4}) {
    double sum = 0.0;
    for (int v = 0; v < 20; ++v) {
      const auto found = tails.ReturnHours("V" + std::to_string(v),
                                           0.4 + 0.1 * std::log(hours));
      ASSERT_TRUE(found);
      sum += std::log(*found / hours) / 20.0;
    }
    // Upper bounds of the scale make it rather too short.
    EXPECT_GT(std::exp(sum), 0.3) << hours;
    EXPECT_LT(std::exp(sum), 1.3) << hours;
  }
}

TEST(ShareTailsTest, AReturnPeriodGrowsWithTheShareUpToTenTimesTheHours) {
  const ShareTails tails(Fleet(4, 300));
  double last = 0.0;
  for (const double share : {1.01, 1.1, 1.2, 1.3}) {
    const double found = *tails.ReturnHours("V1", share);
    EXPECT_GT(found, last);
    last = found;
  }
  EXPECT_EQ(tails.ReturnHours("V1", 1e9), 12'000.0);
  EXPECT_EQ(tails.ReturnHours("V1", 1e300), 12'000.0);
}

TEST(ShareTailsTest, WithTooFewHoursThereIsNone) {
  EXPECT_FALSE(ShareTails({}).ReturnHours("V0", 2.0));
  EXPECT_FALSE(ShareTails(Fleet(1, 5000)).ReturnHours("V0", 2.0));
  EXPECT_FALSE(ShareTails(Fleet(2, 5000)).ReturnHours("V0", 2.0));
  EXPECT_TRUE(ShareTails(Fleet(3, 250)).ReturnHours("V0", 2.0));
  EXPECT_FALSE(ShareTails(Fleet(3, 249)).ReturnHours("V0", 2.0));
  EXPECT_FALSE(ShareTails(Fleet(20, 71)).ReturnHours("V0", 2.0));
  EXPECT_FALSE(ShareTails(Fleet(20, 100, 2)).ReturnHours("V0", 2.0));
  std::vector<HealthyHours> fleet = Fleet(10, 100);
  fleet.push_back({.valve_id = "NEW"});
  const ShareTails tails(fleet);
  EXPECT_TRUE(tails.ReturnHours("V0", 2.0));
  EXPECT_FALSE(tails.ReturnHours("NEW", 2.0));
  EXPECT_FALSE(tails.ReturnHours("NOT_THERE", 2.0));
}

TEST(ShareTailsTest, HoursThatAreAllTheSameHaveNoTail) {
  std::vector<HealthyHours> fleet = Fleet(4, 300);
  fleet[2].hours.assign(300, {0, 0.5});
  const ShareTails tails(fleet);
  EXPECT_FALSE(tails.ReturnHours("V2", 2.0));
  EXPECT_TRUE(tails.ReturnHours("V1", 2.0));
  for (HealthyHours& valve : fleet) {
    valve.hours.assign(300, {0, 0.5});
  }
  EXPECT_EQ(ShareTails(fleet).longest_hours(), 0.0);
}

// It is known only that 13 % of these hours reached a limit. Taken as
// if they had been no higher, they would make a share of 2 seem ten times as
// rare.
TEST(ShareTailsTest, EpisodesThatNobodyHasJudgedReachedALimitOrMore) {
  std::vector<HealthyHours> labelled = Fleet(20, 300);
  std::vector<HealthyHours> unlabelled = labelled;
  std::vector<HealthyHours> no_higher = labelled;
  for (std::size_t v = 0; v < labelled.size(); ++v) {
    for (std::size_t i = 0; i < labelled[v].hours.size(); ++i) {
      const double share = 3.0 * labelled[v].hours[i].share - 0.8;
      labelled[v].hours[i].share = share;
      unlabelled[v].hours[i].share = std::min(share, 1.0);
      unlabelled[v].hours[i].at_least = share > 1.0;
      no_higher[v].hours[i].share = std::min(share, 1.0);
    }
  }
  const double with_labels = *ShareTails(labelled).ReturnHours("V1", 2.0);
  const double without = *ShareTails(unlabelled).ReturnHours("V1", 2.0);
  EXPECT_GT(without, with_labels / 3.0);
  EXPECT_LT(without, with_labels * 3.0);
  EXPECT_GT(*ShareTails(no_higher).ReturnHours("V1", 2.0), 10.0 * with_labels);
}

// 95 % bounds of what was counted: 3.00 of none, 6.30 of two.
TEST(ShareTailsTest, EpisodesBeyondNoLimitAreCounted) {
  std::vector<HealthyHours> fleet = Fleet(4, 300);
  EXPECT_NEAR(*ShareTails(fleet).ReturnHours("V1", 0.0), 1200 / 2.996, 1.0);
  fleet[0].others = 2;
  EXPECT_NEAR(*ShareTails(fleet).ReturnHours("V1", 0.3), 1200 / 6.296, 1.0);
}

// A fifth of independent hours follows one of the highest fifth: 0.2 of 20 x
// 60, whose 95 % bound is 0.22.
TEST(ShareTailsTest, AReturnPeriodGrowsWithTheHoursThatItLasts) {
  const ShareTails tails(Fleet(20, 300));
  EXPECT_NEAR(tails.goes_on(), 0.22, 0.025);
  const double first = *tails.ReturnHours("V1", 1.01);
  EXPECT_NEAR(*tails.ReturnHours("V1", 1.01, 2),
              first / (tails.goes_on() * tails.goes_on()), 1e-6 * first);
  EXPECT_EQ(tails.ReturnHours("V1", 1.01, 100'000), 60'000.0);
}

// Alternate days: whoever is high stays so, and growth is as slow as that.
TEST(ShareTailsTest, HoursThatDependOnEachOtherGrowSlowly) {
  std::vector<HealthyHours> fleet = Fleet(4, 300);
  for (HealthyHours& valve : fleet) {
    std::ranges::sort(valve.hours, {}, &HealthyHours::Hour::share);
    for (std::size_t i = 0; i < valve.hours.size(); ++i) {
      valve.hours[i].hour = static_cast<std::int64_t>(i);
    }
  }
  EXPECT_GT(ShareTails(fleet).goes_on(), 0.98);
  for (HealthyHours& valve : fleet) {
    for (HealthyHours::Hour& each : valve.hours) {
      each.hour *= 2;
    }
  }
  // No hour has a next one, so nothing is known.
  EXPECT_EQ(ShareTails(fleet).goes_on(), 1.0);
}

// An episode that nobody has judged was in each of its hours above the level.
TEST(ShareTailsTest, LongEpisodesOfHealthyValvesSlowTheGrowth) {
  std::vector<HealthyHours> fleet = Fleet(20, 300);
  const double without = ShareTails(fleet).goes_on();
  fleet[3].hours.push_back({400, 1.0, 600});
  EXPECT_GT(ShareTails(fleet).goes_on(), without + 0.2);
}

// Five of 3 h each: 15 of 20 hours were followed by another.
TEST(ShareTailsTest, EpisodesBeyondNoLimitGrowByTheirOwnHours) {
  std::vector<HealthyHours> fleet = Fleet(4, 300);
  EXPECT_EQ(ShareTails(fleet).ReturnHours("V1", 0.0, 9),
            ShareTails(fleet).ReturnHours("V1", 0.0));
  fleet[0].others = 5;
  fleet[0].others_lasted = 15;
  const ShareTails tails(fleet);
  const double first = *tails.ReturnHours("V1", 0.0);
  EXPECT_NEAR(*tails.ReturnHours("V1", 0.0, 5),
              first / std::pow(ProbabilityBound(15, 20), 5), 1e-6 * first);
  EXPECT_GT(ProbabilityBound(15, 20), 0.75);
}

TEST(AlarmBudgetTest, WhatIsTooCommonForTheBudgetIsANotice) {
  const std::vector<HealthyHours> fleet = Fleet(20, 300);
  const AlarmBudget day(24.0, fleet);
  EXPECT_EQ(day.Now().needed_hours, 480.0);
  EXPECT_EQ(day.Now().wait_hours, 0.0);
  EXPECT_EQ(PromiseText(day.Now()), "yes");
  const AlarmBudget month(730.5, fleet);
  EXPECT_EQ(month.Now().needed_hours, 14'610.0);
  for (const double share : {1.01, 1.05, 1.1, 1.2, 1.3, 1.5, 2.0}) {
    const double hours = *day.Weigh("V3", share).return_hours;
    EXPECT_EQ(day.Weigh("V3", share).notice, hours < 480.0) << share;
    EXPECT_EQ(month.Weigh("V3", share).notice, hours < 14'610.0) << share;
  }
  EXPECT_TRUE(month.Weigh("V3", 1.05).notice);
  EXPECT_FALSE(month.Weigh("V3", 2.0).notice);
  EXPECT_FALSE(month.Weigh("V3", 1.05, 10).notice);
}

// 6000 hours without one say at most one in 2003 h, which is less than a month
// of 20 valves needs, but all that can be said. Three in them are more common.
TEST(AlarmBudgetTest, AnEpisodeBeyondNoLimitIsANoticeOnceSuchAreKnown) {
  std::vector<HealthyHours> fleet = Fleet(20, 300);
  EXPECT_FALSE(AlarmBudget(730.5, fleet).Weigh("V3", 0.5).notice);
  fleet[0].others = 3;
  const AlarmBudget budget(730.5, fleet);
  EXPECT_TRUE(budget.Weigh("V3", 0.5).notice);
  EXPECT_FALSE(budget.Weigh("V3", 0.5, 24).notice);
}

// A year for 20 valves takes 17 532 hours of 20 valves: nothing is a notice for
// want of hours alone, and what is missing is said.
TEST(AlarmBudgetTest, ABudgetThatCannotBeMetKeepsWhatItCan) {
  const AlarmBudget budget(8766.0, Fleet(20, 300));
  EXPECT_EQ(budget.Now().needed_hours, 175'320.0);
  EXPECT_EQ(budget.Now().longest_hours, 60'000.0);
  ASSERT_TRUE(budget.Now().wait_hours);
  EXPECT_NEAR(*budget.Now().wait_hours, (17'532.0 - 6000.0) / 20.0, 1.0);
  EXPECT_THAT(PromiseText(budget.Now()), HasSubstr("577 more hours"));
  EXPECT_FALSE(budget.Weigh("V3", 10.0).notice);
  EXPECT_TRUE(budget.Weigh("V3", 1.1).notice);
}

TEST(AlarmBudgetTest, WithoutHoursEveryEpisodeIsAnAlarm) {
  for (const auto& fleet :
       {std::vector<HealthyHours>{}, Fleet(1, 5000), Fleet(20, 2, 1)}) {
    const AlarmBudget budget(8766.0, fleet);
    EXPECT_FALSE(budget.Weigh("V0", 1.01).notice);
    EXPECT_FALSE(budget.Weigh("V0", 1.01).return_hours);
  }
  EXPECT_THAT(PromiseText(AlarmBudget(24.0, Fleet(1, 5000)).Now()),
              HasSubstr("three valves"));
  // Two hours: 70 more make 72, and three days of 20 valves more than 527.
  EXPECT_EQ(AlarmBudget(24.0, Fleet(20, 2, 1)).Now().wait_hours, 70.0);
}

TEST(AlarmBudgetTest, AValveThatUsesMoreThanItsShareIsTold) {
  std::vector<HealthyHours> fleet = Fleet(20, 300);
  fleet[4].alarms = 1;  // 300/3360 are its share; P(1 or more) is 9 %.
  fleet[5].alarms = 2;  // 0.4 %
  const AlarmBudget week(168.0, fleet);
  ASSERT_EQ(week.spenders().size(), 1U);
  EXPECT_EQ(week.spenders()[0].valve_id, "V5");
  EXPECT_EQ(week.spenders()[0].alarms, 2);
  EXPECT_NEAR(week.spenders()[0].share, 0.0893, 1e-4);
}

}  // namespace
}  // namespace fdi
