// The cost of waiting, and whether a finding can wait until the stop.
#include "planner/work_costs.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/time_units.h"
#include "planner/work_list.h"
#include "planner/work_report.h"
#include "report/shared_files.h"
#include "tests/storage/history_fixture.h"

namespace fdi::planner {
namespace {

using report::Json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kBegin = 480'000;  // Hours since 1970.
constexpr std::int64_t kBeginNs = kBegin * kNsPerHour;

const report::FaultTexts& Catalogue() {
  static const report::FaultTexts texts(report::SharedFile("faults.toml"));
  return texts;
}

TEST(ValveCostsTest, UnitsSayWhatAFigureIsOf) {
  const ValveCosts costs = ParseCosts("12.5 EUR/t, 4000 EUR/h;350 EUR");
  EXPECT_EQ(costs.currency, "EUR");
  EXPECT_EQ(costs.medium, 12.5);
  EXPECT_EQ(costs.flow, FlowUnit::kTPerHour);
  EXPECT_EQ(costs.downtime, 4000.0);
  EXPECT_EQ(costs.visit, 350.0);
  EXPECT_EQ(ParseCosts("1 $/m3").flow, FlowUnit::kM3PerHour);
  EXPECT_FALSE(ParseCosts("1 $/m3").visit);
  EXPECT_FALSE(ParseCosts("").medium);
}

TEST(ValveCostsTest, AWrongFigureSaysWhatIsAccepted) {
  for (const auto& [text, reason] :
       {std::pair("-1 EUR/t", "not negative"),
        {"EUR 3", "begin with an amount"},
        {"3 EUR/kg", "none of /t, /m3 and /h"},
        {"3", "no currency"},
        {"3 /t", "no currency"},
        {"3 EUR, 4 EUR", "same kind"},
        {"3 EUR/t, 3 EUR/m3", "same kind"},
        {"3 EUR, 4 $/t", "another figure is in EUR"},
        {"3 EUR,,4 EUR/t", "begin with an amount"}}) {
    try {
      ParseCosts(text);
      ADD_FAILURE() << text;
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr(reason), HasSubstr("EUR/t")))
          << text;
    }
  }
}

class WorkCostsTest : public testing::Test {
 protected:
  // An hour with F expected at 20 in bin `bin` of CV, and `residual` more.
  static HealthHour Hour(std::int64_t hour, std::size_t bin, double residual,
                         double shut_share = 0.0) {
    HealthHour of;
    of.hour = kBegin + hour;
    of.flow_unit = FlowUnit::kTPerHour;
    of.seen_ms = of.live_ms = kMsPerHour;
    of.shut_ms = static_cast<std::int64_t>(shut_share * kMsPerHour);
    of.channels = {{Signal::kX, -10}, {Signal::kF, -10}};
    const auto quanta = [](double value) {
      return static_cast<std::int64_t>(3600.0 * 1024.0 * value);
    };
    of.bins[bin] = {{3600, 0, 0, quanta(50.0)},
                    {3600, quanta(residual), 0, quanta(20.0 + residual)}};
    return of;
  }
  static StrengthPoint Point(int fault, double hours, double strength) {
    StrengthPoint point;
    point.fault = fault;
    point.stamp_ns = kBeginNs + static_cast<std::int64_t>(
                                    hours * static_cast<double>(kNsPerHour));
    point.strength = strength;
    point.lowest = strength - 0.1;
    point.highest = strength + 0.1;
    return point;
  }
  static findings::Finding Of(const std::string& fault,
                              Certainty certainty = Certainty::kSure) {
    findings::Finding finding;
    finding.kind = "episode";
    finding.fault = fault;
    finding.certainty = certainty;
    finding.about.costs = "10 EUR/t, 84 EUR";
    finding.words.severity = Severity::kMedium;
    return finding;
  }
};

TEST_F(WorkCostsTest, ALeakOutsideLosesAShareOfTheFlowExpected) {
  const std::vector hours = {Hour(0, 4, -1.0), Hour(1, 6, -1.0)};
  const std::vector strengths = {Point(5, 1.0, 0.5)};
  const auto waiting = WaitingOf(Of("f5"), strengths, hours);
  ASSERT_TRUE(waiting);
  EXPECT_NEAR(waiting->loss.value, 0.05 * 0.5 * 20.0, 1e-6);
  EXPECT_NEAR(waiting->loss.lowest, 0.05 * 0.4 * 20.0, 1e-6);
  EXPECT_NEAR(waiting->loss.highest, 0.05 * 0.6 * 20.0, 1e-6);
  EXPECT_NEAR(waiting->week().value, 0.5 * 10.0 * 168.0, 1e-3);
  EXPECT_EQ(waiting->text,
            "waiting a week costs 840 EUR (672..1008): 0.500 t/h "
            "(0.400..0.600) leak out at 10.0 EUR/t; a visit (84.0 EUR) is paid "
            "for in 0.700 days");
  EXPECT_THAT(WaitingOf(Of("f5", Certainty::kOneOf), strengths, hours)->text,
              testing::StartsWith("if it leaks outside, waiting"));
  EXPECT_THAT(WaitingOf(Of("f2|f5"), strengths, hours)->text,
              testing::StartsWith("if it leaks outside, waiting"));
  // A strength of either sign: the interval begins at nothing.
  const auto either = WaitingOf(Of("f5"), {Point(5, 1.0, 0.05)}, hours);
  EXPECT_EQ(either->loss.lowest, 0.0);
  EXPECT_NEAR(either->loss.highest, 0.05 * 0.15 * 20.0, 1e-6);
  // Hours in another unit, before the valve was onboarded again, do not count.
  auto mixed = hours;
  mixed.insert(mixed.begin(), Hour(-1, 4, 40.0));
  mixed.front().flow_unit = FlowUnit::kM3PerHour;
  EXPECT_NEAR(WaitingOf(Of("f5"), strengths, mixed)->loss.value, 0.5, 1e-6);
  // Neither a strength nor hours: nobody knows.
  EXPECT_FALSE(WaitingOf(Of("f5"), {}, hours));
  EXPECT_FALSE(WaitingOf(Of("f5"), strengths, {}));
}

TEST_F(WorkCostsTest, ALeakThroughLosesWhatPassesTheShutValve) {
  // Open, the leak is no loss; shut for a quarter of each hour, it is.
  std::vector hours = {Hour(0, 4, 3.0), Hour(1, 9, 1.0, 0.5),
                       Hour(2, 9, 3.0, 0.5), Hour(3, 4, 3.0)};
  for (const char* fault : {"f6", "f18", "shut_flow", "f6|f18"}) {
    const auto waiting = WaitingOf(Of(fault), {}, hours);
    ASSERT_TRUE(waiting) << fault;
    EXPECT_NEAR(waiting->loss.value, 0.25 * 2.0, 1e-6);
    EXPECT_NEAR(waiting->loss.lowest, 0.25 * 1.0, 1e-6);
    EXPECT_NEAR(waiting->loss.highest, 0.25 * 3.0, 1e-6);
    EXPECT_THAT(waiting->text,
                testing::StartsWith("waiting a week costs 840 EUR"));
  }
  // Whichever of two it is, it is a leak.
  findings::Finding one_of = Of("f6", Certainty::kOneOf);
  EXPECT_THAT(WaitingOf(one_of, {}, hours)->text,
              testing::StartsWith("if it leaks through, "));
  one_of.look_alikes = {"f18"};
  EXPECT_THAT(WaitingOf(one_of, {}, hours)->text,
              testing::StartsWith("waiting a week"));
  // Most samples are of one hour, which the percentiles leave out.
  std::vector<HealthHour> one(30, Hour(1, 9, 0.1, 0.01));
  for (HealthHour& hour : one) {
    hour.bins[9][1] = {36, 36 * 102, 0, 36 * 20 * 1024};
  }
  one.back() = Hour(1, 9, 10.0, 1.0);
  const auto uneven = WaitingOf(Of("f6"), {}, one);
  EXPECT_LE(uneven->loss.lowest, uneven->loss.value);
  EXPECT_GE(uneven->loss.highest, uneven->loss.value);
  // A week ago counts no more, and one hour has no interval.
  hours.push_back(Hour(300, 9, 2.0, 1.0));
  EXPECT_FALSE(WaitingOf(Of("f6"), {}, hours));
}

TEST_F(WorkCostsTest, NothingIsSaidWithoutAPriceOrALoss) {
  const std::vector hours = {Hour(0, 9, 1.0, 1.0), Hour(1, 9, 1.0, 1.0)};
  const std::vector strengths = {Point(19, 1.0, 0.5), Point(2, 1.0, 0.5)};
  for (const char* fault : {"f2", "f3", "f19", "unknown", ""}) {
    EXPECT_FALSE(WaitingOf(Of(fault), strengths, hours)) << fault;
  }
  findings::Finding finding = Of("f6");
  finding.about.costs = "350 EUR";
  EXPECT_FALSE(WaitingOf(finding, strengths, hours));
  finding.about.costs = "10 EUR/m3";
  const auto other = WaitingOf(finding, strengths, hours);
  ASSERT_TRUE(other);
  EXPECT_EQ(other->loss.value, 0.0);
  EXPECT_THAT(other->text, HasSubstr("not known: F is in t/h"));
}

TEST_F(WorkCostsTest, SafeIsWhatGetsNoGraverBeforeTheStop) {
  // f19 grows by 1 % a day: medium below 25 %, high from there.
  std::vector<StrengthPoint> points;
  for (int hour = 0; hour <= 96; ++hour) {
    points.push_back(Point(19, hour, 0.05 + 0.01 * hour / 24.0));
    points.back().lowest = points.back().strength - 0.01;
    points.back().highest = points.back().strength + 0.01;
  }
  const auto safe = [&](int days) {
    return SafeUntil(Of("f19"), points, Catalogue(),
                     points.back().stamp_ns + days * kNsPerDay);
  };
  EXPECT_EQ(safe(8).safe, "yes");
  EXPECT_EQ(safe(16).safe, "perhaps");
  EXPECT_EQ(safe(40).safe, "no");
  EXPECT_THAT(safe(16).text, HasSubstr(" % by then, high from 25 %"));
  // Two faults: each with its reason.
  auto both = points;
  for (StrengthPoint point : points) {
    point.fault = 2;
    both.push_back(point);
  }
  EXPECT_THAT(SafeUntil(Of("f2|f19"), both, Catalogue(),
                        points.back().stamp_ns + 16 * kNsPerDay)
                  .text,
              AllOf(testing::StartsWith("f2: strength "),
                    HasSubstr("; f19: strength ")));
  findings::Finding finding = Of("f19");
  finding.words.severity = Severity::kCritical;
  EXPECT_EQ(SafeUntil(finding, points, Catalogue(), kBeginNs).safe, "no");
  points.resize(2);
  EXPECT_EQ(safe(1).safe, "not known");
  EXPECT_EQ(SafeUntil(Of(""), points, Catalogue(), kBeginNs).safe, "not known");
}

TEST_F(WorkCostsTest, ALimitIsSafeIfItsWholeIntervalIsLater) {
  HealthForecast forecast;
  forecast.last_day = 20'000;
  const auto safe = [&forecast](int days) {
    return SafeUntil(forecast, (20'000 + days) * kNsPerDay).safe;
  };
  EXPECT_EQ(safe(10), "not known");
  forecast.answer = HealthForecast::Answer::kTime;
  forecast.time = {30.0, 20.0, 50.0};
  EXPECT_EQ(safe(10), "yes");
  EXPECT_EQ(safe(30), "perhaps");
  EXPECT_EQ(safe(60), "no");
  forecast.answer = HealthForecast::Answer::kReached;
  EXPECT_EQ(safe(10), "no");
}

class WorkListCostsTest : public storage::HistoryFixture {
 protected:
  // f5 stands, with a strength and two hours of flow.
  WorkListCostsTest() {
    models_.faults = {1, 5, 19};
    storage::HistoryWriter writer(path_);
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
    writer.Record(Event(TransitionKind::kIsolated, 20, 0b010, 0.8), kDetected);
    StrengthPoint point;
    point.episode_id = Id();
    point.stamp_ns = kDetected + 600 * kSecond;
    point.fault = 5;
    point.strength = 0.5;
    point.lowest = 0.4;
    point.highest = 0.6;
    writer.StoreStrength(point);
    Checkpoint checkpoint;
    for (int i = 1; i < 3; ++i) {
      HealthHour& hour = checkpoint.health.emplace_back();
      hour.valve_id = "LV-1";
      hour.hour = kDetected / kNsPerHour + i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = kMsPerHour;
      hour.channels = {{Signal::kF, 0}};
      hour.bins[5] = {{3600, 0, 0, 3600 * 100}};
    }
    writer.CommitCheckpoint(checkpoint);
    query_.now_ns = kDetected + kNsPerDay;
    query_.since_ns = kDetected - kNsPerDay;
    query_.limits = DefaultLimits();
    query_.loops = {{"LV-1", {}}};
  }
  report::Report List() {
    storage::HistoryReader reader(path_);
    return WorkListReport(WorkList(&reader, Catalogue(), query_));
  }
  std::string Csv() {
    std::ostringstream out;
    List().PrintCsv(out);
    return out.str();
  }

  WorkQuery query_;
};

TEST_F(WorkListCostsTest, WithoutFiguresNothingIsSaid) {
  const Json row = List().document["rows"][0];
  EXPECT_FALSE(row.contains("waiting"));
  EXPECT_FALSE(row.contains("safe_until_stop"));
  EXPECT_THAT(row["why"].get<std::string>(), Not(HasSubstr("waiting")));
  EXPECT_THAT(Csv(), AllOf(Not(HasSubstr("waiting")), Not(HasSubstr("safe"))));
}

TEST_F(WorkListCostsTest, FiguresStandInTheRowAndInColumnsOfTheirOwn) {
  query_.loops[0].about.costs = "2 EUR/m3, 4000 EUR/h";
  query_.stop_ns = kDetected + 20 * kNsPerDay;
  const Json row = List().document["rows"][0];
  EXPECT_NEAR(row["waiting"]["week"]["value"].get<double>(),
              0.05 * 0.5 * 100.0 * 2.0 * 168.0, 1e-3);
  EXPECT_NEAR(row["waiting"]["loss"]["highest"].get<double>(), 3.0, 1e-6);
  EXPECT_EQ(row["safe_until_stop"], "not known");
  EXPECT_THAT(row["why"].get<std::string>(),
              AllOf(HasSubstr("; waiting a week costs 840 EUR (672..1008)"),
                    HasSubstr("; safe until the stop on 2026-12-10: not known, "
                              "too few strengths"),
                    HasSubstr("; an hour of downtime costs 4000 EUR")));
  EXPECT_THAT(Csv(),
              AllOf(HasSubstr("waiting_week_value"), HasSubstr(",840.0,672.0,"),
                    HasSubstr(",not known")));
  EXPECT_TRUE(row["about"].is_null());
}

// Costs of a later version, or damaged ones: the list has its rows all the
// same.
TEST_F(WorkListCostsTest, CostsThatCannotBeReadAreLeftOutAndSaidSo) {
  query_.stop_ns = kDetected + 20 * kNsPerDay;
  for (const char* const costs :
       {"2 EUR/m3, 9 EUR/kWh", "\xff\x01\xc3", "2 EUR/m3, 3 USD/h"}) {
    query_.loops[0].about.costs = costs;
    const Json row = List().document["rows"].at(0);
    EXPECT_EQ(row["fault"], "f5");
    EXPECT_EQ(row["safe_until_stop"], "not known");
    EXPECT_FALSE(row.contains("waiting"));
    EXPECT_THAT(row["why"].get<std::string>(),
                AllOf(HasSubstr("; the costs of LV-1 in models.db are left "
                                "out: costs "),
                      HasSubstr("; safe until the stop"),
                      Not(HasSubstr("downtime costs 4000"))));
    EXPECT_THAT(Csv(), HasSubstr("LV-1"));
  }
}

}  // namespace
}  // namespace fdi::planner
