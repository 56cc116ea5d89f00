#include "base/time_text.h"

#include <cstdlib>
#include <ctime>
#include <future>
#include <limits>
#include <span>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/storage/message_of.h"

namespace fdi {
namespace {

// date -u -d 2026-11-20T14:56:11Z +%s
constexpr std::int64_t kStampNs = 1'795'186'571'000'000'000;

class TimeTextTest : public testing::Test {
 protected:
  void SetUp() override {
    setenv("TZ", "Europe/Warsaw", 1);  // +01:00 in November, +02:00 in July.
    tzset();
  }
  void TearDown() override {
    unsetenv("TZ");
    tzset();
  }
};

TEST_F(TimeTextTest, UtcEndsInZAndLocalTimeInItsOffset) {
  EXPECT_EQ(FormatTime(kStampNs, true), "2026-11-20T14:56:11Z");
  EXPECT_EQ(FormatTime(kStampNs, false), "2026-11-20T15:56:11+01:00");
}

TEST_F(TimeTextTest, YearsOfTwoDigitsNeedPointsAMonthOrAnOrder) {
  const auto date = [](const char* text, DateOrder order) {
    const auto time = ScanTime(text, order);
    return time ? std::to_string(time->fields.tm_year + 1900) + '-' +
                      std::to_string(time->fields.tm_mon + 1) + '-' +
                      std::to_string(time->fields.tm_mday)
                : "none";
  };
  EXPECT_EQ(date("3/10/26 09:00:00", DateOrder::kMonthFirst), "2026-3-10");
  EXPECT_EQ(date("3/10/26 09:00:00", DateOrder::kDayFirst), "2026-10-3");
  EXPECT_EQ(date("26/3/10 09:00", DateOrder::kYearFirst), "2026-3-10");
  EXPECT_EQ(date("10.03.99", DateOrder::kNotSaid), "1999-3-10");
  EXPECT_EQ(date("10-Mar-26 09:00", DateOrder::kNotSaid), "2026-3-10");
  EXPECT_EQ(date("3/10/26", DateOrder::kNotSaid), "none");
}

TEST_F(TimeTextTest, TimesAreReadAsHistoriansAndSpreadsheetsWriteThem) {
  LocalClock clock("UTC");
  for (const char* text :
       {"2026-03-10T09:00:00Z",
        "2026-W11-2T09:00:00",
        "2026-069T09:00:00Z",
        "20260310T090000Z",
        "20260310090000",
        "20260310 09:00",
        "2026-03-10 10:00:00 CET",
        "2026-03-10 11:00 CEST",
        "2026/03/10 10:00 UTC+01:00",
        "2026-03-10T10:00+01:00[Europe/Berlin]",
        "Tue Mar 10 05:00:00 EDT 2026",
        "Tue Mar 10 2026 10:00:00 GMT+0100 (Central European Standard Time)",
        "Tue, 10 Mar 2026 09:00:00 GMT",
        "March 10, 2026 9:00 AM",
        "3/10/2026, 9:00:00\u202fAM",
        "3/10/26 9:00 a. m.",
        "10-Mrz-2026 09:00:00",
        "10. März 2026 09:00",
        "10 mars 2026 09:00",
        "10.Mar.2026 09:00:00:000"}) {
    const auto time = ScanTime(text, DateOrder::kMonthFirst);
    ASSERT_TRUE(time) << text;
    EXPECT_EQ(clock.Utc(*time, 0), 1'773'133'200'000'000'000) << text;
  }
  const std::pair<const char*, int> months[] = {
      {"févr.", 2}, {"kwi", 4}, {"Mai", 5},  {"juin", 6},      {"juil.", 7},
      {"août", 8},  {"wrz", 9}, {"paź", 10}, {"listopad", 11}, {"Dez", 12}};
  for (const auto& [month, number] : months) {
    const auto time = ScanTime("10 " + std::string(month) + " 2026 09:00");
    ASSERT_TRUE(time) << month;
    EXPECT_EQ(time->fields.tm_mon + 1, number) << month;
  }
  // Zones of several countries, weeks and days that do not exist, numbers.
  for (const char* text :
       {"2026-03-10 09:00:00 CST", "2026-W54-1", "2026-W11-8", "2026-366",
        "20261310090000", "46091416666667", "20260310", "12345678", "Average",
        "2026-03-10 09:00:00:25"}) {
    EXPECT_FALSE(ScanTime(text)) << text;
  }
}

TEST_F(TimeTextTest, ANameOfAZoneKeepsItsSummerTime) {
  EXPECT_EQ(LocalClock("CET").Utc(*ScanTime("2026-07-10 09:00"), 0),
            LocalClock("Europe/Berlin").Utc(*ScanTime("2026-07-10 09:00"), 0));
  EXPECT_THROW(LocalClock("Europe/Atlantis"), ConfigError);
  EXPECT_THROW(LocalClock("../zoneinfo/UTC"), ConfigError);
}

// A time that a clock of a zone shows, and the instant that it is.
struct Shown {
  const char* text;
  const char* utc;    // "none": the clock never showed it.
  const char* after;  // For an hour shown twice: the row before.
};

std::string UtcOf(const LocalClock& clock, const Shown& shown) {
  const auto stamp =
      clock.Utc(*ScanTime(shown.text), ParseTime(shown.after, true));
  return stamp ? FormatTime(*stamp, true) : "none";
}

constexpr Shown kNewYork[] = {
    {"2026-03-08 01:59:59", "2026-03-08T06:59:59Z", "2026-01-01"},
    {"2026-03-08 02:30", "none", "2026-01-01"},
    {"2026-03-08 03:00", "2026-03-08T07:00:00Z", "2026-01-01"},
    {"2026-07-10 09:00", "2026-07-10T13:00:00Z", "2026-01-01"},
    {"2026-11-01 01:30", "2026-11-01T05:30:00Z", "2026-01-01"},
    {"2026-11-01 01:30", "2026-11-01T06:30:00Z", "2026-11-01 05:45"},
    {"2026-11-01 02:00", "2026-11-01T07:00:00Z", "2026-01-01"}};

// Its summer is half an hour ahead, and ends in April.
constexpr Shown kLordHowe[] = {
    {"2026-04-05 01:45", "2026-04-04T14:45:00Z", "2026-01-01"},
    {"2026-04-05 01:45", "2026-04-04T15:15:00Z", "2026-04-04 14:50"},
    {"2026-07-10 09:00", "2026-07-09T22:30:00Z", "2026-01-01"},
    {"2026-10-04 02:15", "none", "2026-01-01"},
    {"2026-10-04 02:30", "2026-10-03T15:30:00Z", "2026-01-01"}};

TEST_F(TimeTextTest, GapAndOverlapAreThoseOfTheZone) {
  for (const Shown& shown : kNewYork) {
    EXPECT_EQ(UtcOf(LocalClock("America/New_York"), shown), shown.utc);
  }
  for (const Shown& shown : kLordHowe) {
    EXPECT_EQ(UtcOf(LocalClock("Australia/Lord_Howe"), shown), shown.utc);
  }
  // Those of the machine, which is in Warsaw here.
  EXPECT_EQ(UtcOf(LocalClock(""), {"2026-03-29 02:30", "", "1970-01-01"}),
            "none");
  EXPECT_EQ(UtcOf(LocalClock(""), {"2026-10-25 02:30", "", "1970-01-01"}),
            "2026-10-25T00:30:00Z");
  EXPECT_EQ(UtcOf(LocalClock(""), {"2026-10-25 02:30", "", "2026-10-25 00:45"}),
            "2026-10-25T01:30:00Z");
  // Samoa has skipped a whole day.
  const LocalClock samoa("Pacific/Apia");
  EXPECT_EQ(UtcOf(samoa, {"2011-12-30 12:00", "", "1970-01-01"}), "none");
  EXPECT_EQ(UtcOf(samoa, {"2011-12-31 00:00", "", "1970-01-01"}),
            "2011-12-30T10:00:00Z");
}

// Records of a plant are read by several threads at a time.
TEST_F(TimeTextTest, ThreadsConvertInZonesOfTheirOwn) {
  const auto wrong = [](const char* zone, std::span<const Shown> all) {
    int count = 0;
    LocalClock clock(zone);
    for (int i = 0; i < 2000; ++i) {
      for (const Shown& shown : all) {
        count += UtcOf(clock, shown) == shown.utc ? 0 : 1;
      }
    }
    return count;
  };
  auto east = std::async(std::launch::async, wrong, "Australia/Lord_Howe",
                         std::span(kLordHowe));
  auto west = std::async(std::launch::async, wrong, "America/New_York",
                         std::span(kNewYork));
  EXPECT_EQ(east.get(), 0);
  EXPECT_EQ(west.get(), 0);
}

TEST_F(TimeTextTest, ALeapSecondIsTheFirstOfTheNextDay) {
  constexpr std::int64_t kNewYear = 1'483'228'800'000'000'000;
  EXPECT_EQ(ParseTime("2016-12-31T23:59:60Z", false), kNewYear);
  EXPECT_EQ(
      LocalClock("Europe/Warsaw").Utc(*ScanTime("2017-01-01 00:59:60"), 0),
      kNewYear);
  EXPECT_FALSE(ScanTime("2016-12-31T23:59:61Z"));
}

TEST_F(TimeTextTest, DecimalsAreAsManyAsTheStampNeeds) {
  EXPECT_EQ(FormatTime(kStampNs + 500'000'000, true),
            "2026-11-20T14:56:11.500Z");
  EXPECT_EQ(FormatTime(kStampNs + 1'000, true), "2026-11-20T14:56:11.000001Z");
  EXPECT_EQ(FormatTime(kStampNs + 1, true), "2026-11-20T14:56:11.000000001Z");
}

TEST_F(TimeTextTest, StampsBeforeTheEpochKeepTheirDecimals) {
  EXPECT_EQ(FormatTime(-1, true), "1969-12-31T23:59:59.999999999Z");
  EXPECT_EQ(FormatTime(std::numeric_limits<std::int64_t>::min(), true),
            "1677-09-21T00:12:43.145224192Z");
  EXPECT_EQ(ParseTime("1969-12-31T23:59:59.999999999Z", false), -1);
}

TEST_F(TimeTextTest, ParsingReadsBackWhatFormattingWrote) {
  for (const std::int64_t stamp :
       {kStampNs, kStampNs + 123'456'789, std::int64_t{0},
        std::int64_t{1'000'000'000'000'000'001}}) {
    EXPECT_EQ(ParseTime(FormatTime(stamp, true), false), stamp);
    EXPECT_EQ(ParseTime(FormatTime(stamp, false), true), stamp);
  }
}

TEST_F(TimeTextTest, TimeWithoutOffsetIsLocalUnlessUtcIsAskedFor) {
  EXPECT_EQ(ParseTime("2026-11-20T15:56:11", false), kStampNs);
  EXPECT_EQ(ParseTime("2026-11-20 14:56:11", true), kStampNs);
  EXPECT_EQ(ParseTime("2026-07-01", false),
            ParseTime("2026-06-30T22:00:00Z", false));
}

TEST_F(TimeTextTest, WhatIsNoTimeIsRefused) {
  for (const char* text :
       {"", "yesterday", "2026-13-01", "2026-02-30", "2026-11-20T25:00",
        "2026-11-20T14:56:11.Z", "2026-11-20T14:56:11+1", "2026-11-20x",
        "9999-01-01"}) {
    EXPECT_THROW(ParseTime(text, true), ConfigError) << text;
  }
}

TEST_F(TimeTextTest, DurationsAddUpTheirParts) {
  EXPECT_EQ(ParseDuration("90s"), 90'000'000'000);
  EXPECT_EQ(ParseDuration("90"), 90'000'000'000);
  EXPECT_EQ(ParseDuration("2h"), 7'200'000'000'000);
  EXPECT_EQ(ParseDuration("1h30m"), 5'400'000'000'000);
  EXPECT_EQ(ParseDuration("0.25s"), 250'000'000);
  EXPECT_EQ(ParseDuration("250ms"), 250'000'000);
  EXPECT_EQ(ParseDuration("2d"), 172'800'000'000'000);
}

TEST_F(TimeTextTest, WhatIsNoDurationIsRefused) {
  for (const char* text :
       {"", "h", "2x", "-2h", "1h30", "1..5s", "9e99s", "1e3", "101000d"}) {
    EXPECT_THROW(ParseDuration(text), ConfigError) << text;
  }
}

TEST_F(TimeTextTest, AgoIsADurationBeforeNow) {
  EXPECT_EQ(ParseTimeOrAgo("2h", true, kStampNs), kStampNs - 7'200'000'000'000);
  EXPECT_EQ(ParseTimeOrAgo("now", true, kStampNs), kStampNs);
  EXPECT_EQ(ParseTimeOrAgo("2026-11-20T14:56:11Z", true, 0), kStampNs);
}

TEST_F(TimeTextTest, WhatIsNeitherTimeNorAgoIsToldBoth) {
  for (const char* text : {"yesterday", "-5", "2026-13-01", "5x", ""}) {
    EXPECT_THAT(
        storage::MessageOf<ConfigError>(
            [text] { ParseTimeOrAgo(text, true, kStampNs); }),
        testing::AllOf(testing::StartsWith("'" + std::string(text) + "'"),
                       testing::HasSubstr("2026-11-20T14:56"),
                       testing::HasSubstr("2h")));
  }
}

TEST_F(TimeTextTest, DurationsForPeopleCarryTwoUnitsAtMost) {
  EXPECT_EQ(FormatDuration(250'000'000), "0.25 s");
  EXPECT_EQ(FormatDuration(42'000'000'000), "42 s");
  EXPECT_EQ(FormatDuration(185'000'000'000), "3 min 05 s");
  EXPECT_EQ(FormatDuration(7'800'000'000'000), "2 h 10 min");
  EXPECT_EQ(FormatDuration(356'400'000'000'000), "4 d 03 h");
}

}  // namespace
}  // namespace fdi
