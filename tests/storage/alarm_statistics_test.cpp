#include <limits>

#include <gmock/gmock.h>

#include "storage/history/alarm.h"

namespace fdi::storage {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kMinute = 60 * kSecond;
constexpr std::int64_t kHour = 60 * kMinute;
constexpr std::int64_t kDay = 24 * kHour;
constexpr std::int64_t kEver = std::numeric_limits<std::int64_t>::max();

AlarmSpan Span(const std::string& valve, std::int64_t from_ns,
               std::optional<std::int64_t> to_ns,
               std::optional<std::string> label = {},
               const std::string& fault = "f7") {
  AlarmSpan span;
  span.valve_id = valve;
  span.fault = fault;
  span.detected_ns = from_ns;
  span.ended_ns = to_ns;
  span.label = std::move(label);
  return span;
}

AlarmStatistics Of(const std::vector<AlarmSpan>& spans,
                   std::int64_t now_ns = 10 * kDay) {
  return ComputeAlarmStatistics(spans, 0, kEver, now_ns);
}

TEST(AlarmStatisticsTest, TimeInAlarmIsCutAtMidnight) {
  const auto figures = Of({Span("V", kDay - kHour, kDay + 3 * kHour),
                           Span("W", kDay, kDay + kHour)});

  ASSERT_EQ(figures.days.size(), 2U);
  EXPECT_EQ(figures.days[0].day, 0);
  EXPECT_EQ(figures.days[0].episodes, 1);
  EXPECT_DOUBLE_EQ(figures.days[0].alarm_s, 3600.0);
  EXPECT_EQ(figures.days[1].episodes, 1);
  EXPECT_DOUBLE_EQ(figures.days[1].alarm_s, 4 * 3600.0);
  EXPECT_DOUBLE_EQ(figures.valves.at("V").alarm_s, 4 * 3600.0);
}

// Runs faster than real time are ahead of the clock.
TEST(AlarmStatisticsTest, AnOpenEpisodeLastsToItsNewestEvidence) {
  AlarmSpan ahead = Span("V", 5 * kHour, std::nullopt);
  ahead.last_ns = 6 * kHour;

  const auto figures = Of({ahead, Span("W", kHour, std::nullopt)}, 2 * kHour);

  EXPECT_DOUBLE_EQ(figures.valves.at("V").alarm_s, 3600.0);
  EXPECT_DOUBLE_EQ(figures.valves.at("W").alarm_s, 3600.0);
}

// Also the part of an earlier episode, which is not counted itself.
TEST(AlarmStatisticsTest, OnlyWhatFallsIntoTheTimeCounts) {
  const std::vector<AlarmSpan> spans = {
      Span("V", 0, kHour), Span("V", 2 * kHour, 4 * kHour),
      Span("V", 5 * kHour, std::nullopt), Span("V", 9 * kHour, 10 * kHour)};

  const auto figures =
      ComputeAlarmStatistics(spans, 3 * kHour, 8 * kHour, 7 * kHour);

  const ValveAlarms& valve = figures.valves.at("V");
  EXPECT_EQ(valve.episodes, 1);
  EXPECT_EQ(valve.open, 1);
  EXPECT_DOUBLE_EQ(valve.alarm_s, (1.0 + 2.0) * 3600.0);
  EXPECT_EQ(valve.last_detected_ns, 5 * kHour);
  EXPECT_EQ(figures.unlabelled, 1);
}

TEST(AlarmStatisticsTest, ThreeWithinHalfAnHourAreChattering) {
  const auto at = [](const std::string& valve, std::int64_t minute) {
    return Span(valve, minute * kMinute, minute * kMinute + kSecond);
  };

  // Four in a row, of which no three lie further apart, then a single one.
  const auto figures =
      Of({at("V", 0), at("W", 0), at("V", 10), at("V", 30), at("W", 29),
          at("V", 35), at("W", 31), at("V", 300)});

  EXPECT_EQ(figures.valves.at("V").chattering, 4);
  EXPECT_EQ(figures.valves.at("W").chattering, 0);
}

TEST(AlarmStatisticsTest, WhatLastsMoreThanADayIsStanding) {
  const auto figures =
      Of({Span("V", 0, kDay), Span("V", 0, kDay + kSecond),
          Span("W", 9 * kDay, std::nullopt), Span("X", 0, std::nullopt)});

  EXPECT_EQ(figures.valves.at("V").standing, 1);
  EXPECT_EQ(figures.valves.at("W").standing, 0);
  EXPECT_EQ(figures.valves.at("X").standing, 1);
}

TEST(AlarmStatisticsTest, ALabelIsRightIfTheAnswerHasIt) {
  const auto figures = Of({Span("V", 1, 2, "true"), Span("V", 2, 3, "false"),
                           Span("V", 3, 4, "f7"), Span("V", 4, 5, "f1"),
                           Span("V", 5, 6), Span("V", 6, 7, "f19", "f1|f19")});

  EXPECT_EQ(figures.labelled_true, 4);
  EXPECT_EQ(figures.labelled_false, 1);
  EXPECT_EQ(figures.unlabelled, 1);
  EXPECT_EQ(figures.faults.at("f7").episodes, 5);
  EXPECT_EQ(figures.faults.at("f7").right, 2);
  EXPECT_EQ(figures.faults.at("f7").wrong, 2);
  EXPECT_EQ(figures.faults.at("f1|f19").right, 1);
}

TEST(AlarmStatisticsTest, TheRateIsTheMostInTenMinutesOfThePlant) {
  const auto figures =
      Of({Span("A", 0, 1), Span("B", 9 * kMinute, kHour),
          Span("C", 10 * kMinute, kHour), Span("D", 18 * kMinute, kHour),
          Span("E", 30 * kMinute, kHour)});

  EXPECT_EQ(figures.most_in_flood_window, 3);
}

// The whole days of a long episode are those of its parts.
TEST(AlarmStatisticsTest, WholeDaysCountForEachEpisode) {
  const auto figures =
      Of({Span("V", kHour, 4 * kDay), Span("W", kDay + kHour, 5 * kDay + 1)});

  ASSERT_EQ(figures.days.size(), 6U);
  const double hours[] = {23, 24 + 23, 48, 48, 24, 1e-9 / 3600};
  for (std::size_t day = 0; day < 6; ++day) {
    EXPECT_EQ(figures.days[day].day, static_cast<std::int64_t>(day));
    EXPECT_NEAR(figures.days[day].alarm_s, 3600.0 * hours[day], 1e-9);
  }
}

// Rows of a foreign database: the time of an answer does not grow with theirs.
TEST(AlarmStatisticsTest, StampsThatCannotBeEndNeitherTimeNorSums) {
  constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::min();
  AlarmSpan open = Span("W", kNever, std::nullopt);
  open.last_ns = kEver;
  std::vector<AlarmSpan> spans(1000, open);
  spans.push_back(Span("V", kEver, kNever));
  spans.push_back(Span("V", kNever, kEver));
  spans.push_back(Span("V", kHour, 2 * kHour));

  const auto figures = ComputeAlarmStatistics(spans, kNever, kEver, kDay);

  EXPECT_EQ(figures.valves.at("V").episodes, 3);
  EXPECT_LT(figures.days.size(), 100'000U);
  for (const DayAlarms& day : figures.days) {
    ASSERT_GE(day.alarm_s, 0.0);
    ASSERT_LE(day.alarm_s, 86'400.0 * 1003);
  }
}

}  // namespace
}  // namespace fdi::storage
