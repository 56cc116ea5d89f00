#include "planner/work_list.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/shared_files.h"
#include "storage/history/history_editor.h"
#include "tests/storage/history_fixture.h"

namespace fdi::planner {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kDay = 86'400'000'000'000;
constexpr std::int64_t kNow = 20'000 * kDay;

const report::FaultTexts& Texts() {
  static const report::FaultTexts texts(report::SharedFile("faults.toml"));
  return texts;
}

WorkOptions Options() {
  WorkOptions options;
  options.now_ns = kNow;
  return options;
}

FaultReason Reason(const std::string& fault, double strength,
                   std::optional<double> ended_days_ago = std::nullopt) {
  FaultReason reason;
  reason.fault = fault;
  reason.words = Texts().Words(fault, strength);
  reason.strength = strength;
  reason.factor = 1.0;
  reason.episodes = 1;
  reason.detected_ns = kNow - 100 * kDay;
  if (ended_days_ago) {
    reason.ended_ns =
        kNow - static_cast<std::int64_t>(*ended_days_ago * 86'400e9);
  }
  return reason;
}

ValveWork Valve(const std::string& id, std::vector<FaultReason> faults) {
  ValveWork work;
  work.valve_id = id;
  work.faults = std::move(faults);
  return work;
}

TEST(WorkListTest, WeightIsSeverityConfidenceUrgencyAndRepetition) {
  FaultReason reason = Reason("f19", 0.5);  // high: 4
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 4.0);
  reason.factor = 0.5;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 2.0);
  reason.trust = 0.5;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 1.0);
  reason.confirmed = true;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 4.0);
  reason.episodes = 6;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 6.0);
  reason.episodes = 100;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 8.0);
  EXPECT_DOUBLE_EQ(WeightOf(Reason("f19", 0.5, 30.0), Options()), 2.0);
}

TEST(WorkListTest, TrendsWeighTheMoreTheNearerTheirLimit) {
  LimitTrend reason;
  reason.forecast.answer = HealthForecast::Answer::kTime;
  reason.forecast.time = TimeToLimit{45.0, 30.0, 60.0};
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 3.0);
  reason.forecast.time->days = 400.0;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 0.0);
  reason.forecast.answer = HealthForecast::Answer::kReached;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 4.0);
  reason.forecast.answer = HealthForecast::Answer::kNoTrend;
  EXPECT_DOUBLE_EQ(WeightOf(reason, Options()), 0.0);
}

TEST(WorkListTest, GravestStandsFirstAndReasonsAddUp) {
  const auto rows =
      RankWork({Valve("V1", {Reason("f2", 0.5)}),
                Valve("V2", {Reason("f10", 0.8)}), Valve("V3", {}),
                Valve("V4", {Reason("f2", 0.5, 10.0), Reason("f15", 0.2)})},
               Options());
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0].work.valve_id, "V2");
  EXPECT_EQ(rows[0].rank, 1);
  EXPECT_EQ(rows[1].work.valve_id, "V4");
  EXPECT_EQ(rows[1].work.faults[0].fault, "f15");
  EXPECT_EQ(rows[2].work.valve_id, "V1");
}

TEST(WorkListTest, WhySaysItInTheWordsOfTheCatalogue) {
  FaultReason reason = Reason("f19", -0.5);
  reason.episodes = 3;
  const std::string why = ReasonText(Valve("V1", {reason}), Options());
  EXPECT_EQ(why,
            "Flow transmitter wrong: stands for 100 days, severity high, "
            "strength -50 %, 3 episodes");
}

// Three valves with an episode each, as the history keeps them.
class ReadWorkTest : public storage::HistoryFixture {
 protected:
  ReadWorkTest() : writer_(directory_.path() / "history.db") {
    RecordEpisode(writer_, 4, "V1");  // f19
    RecordEpisode(writer_, 1, "V2");  // f1
    RecordEpisode(writer_, 4, "V3");
    query_.options.now_ns = kDetected + kDay;
    query_.since_ns = kDetected - kDay;
    query_.limits = DefaultLimits();
  }

  std::vector<WorkRow> Read() {
    storage::HistoryReader reader(directory_.path() / "history.db");
    return ReadWorkList(reader, Texts(), query_);
  }
  void Label(const std::string& valve, const std::string& label) {
    storage::HistoryEditor(directory_.path() / "history.db")
        .Label(storage::EpisodeIdText(Id(valve)), label,
               By("anna", kDetected + kSecond));
  }
  // Days whose flow falls by 0.1 % of what is expected a day.
  void AddHealth(const std::string& valve, int days) {
    std::vector<HealthHour> hours;
    for (int i = 0; i < 24 * days; ++i) {
      HealthHour hour;
      hour.valve_id = valve;
      hour.hour = kDetected / (kDay / 24) - 24 * days + i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.travel = 1'000'000;
      hour.channels = {{Signal::kF, -7}};
      const std::int64_t residual = -3600LL * (i / 24) * 5 + (i * 37) % 101;
      hour.bins[5] = {{3600, residual, 0, 3600LL * 5000 + residual}};
      hours.push_back(hour);
    }
    Checkpoint checkpoint;
    checkpoint.health = hours;
    writer_.CommitCheckpoint(checkpoint);
  }

  storage::HistoryWriter writer_;
  WorkQuery query_;
};

TEST_F(ReadWorkTest, EpisodesBecomeReasonsInPlainWords) {
  const auto rows = Read();
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_THAT(rows[0].why, HasSubstr(Texts().Of(19).name));
  EXPECT_THAT(rows[1].why, HasSubstr(Texts().Of(1).name));
}

TEST_F(ReadWorkTest, FalseAlarmsAreNoWorkAndCostTrust) {
  const double before = Read()[1].score;
  Label("V1", "false");
  const auto rows = Read();
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[1].work.valve_id, "V3");
  EXPECT_NEAR(rows[1].score, before / 2.0, 1e-9);
}

TEST_F(ReadWorkTest, WhereOnlyTheDataEndedTheFaultStands) {
  const auto none = EndReason::kNone;
  writer_.Record(Event(TransitionKind::kDetected, 0, 0, 0.3, none, "V4"),
                 kDetected);
  writer_.Record(Event(TransitionKind::kIsolated, 20, 4, 0.8, none, "V4"),
                 kDetected);
  writer_.Record(
      Event(TransitionKind::kClosed, 60, 4, 0.8, EndReason::kStreamEnded, "V4"),
      kDetected);
  query_.valve_glob = "V4";

  const auto rows = Read();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_FALSE(rows[0].work.faults[0].ended_ns);
  EXPECT_THAT(rows[0].why,
              HasSubstr("stands for 24 h, not confirmed for 24 h"));
  query_.options.now_ns = kDetected + 80 * kSecond;
  EXPECT_THAT(
      Read()[0].why,
      HasSubstr("stands for 1 min, not confirmed for less than a minute"));
}

// What is only detected is not "unlike any known fault", nor of strength 0.
TEST_F(ReadWorkTest, WhatHasNoNameYetIsSaidSo) {
  writer_.Record(
      Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "V4"),
      kDetected);
  query_.valve_glob = "V4";

  const auto rows = Read();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_THAT(rows[0].why, testing::StartsWith("Fault without a name yet: "));
  const report::Json row = WorkListReport(rows).document["rows"][0];
  EXPECT_TRUE(row["fault"].is_null());
  EXPECT_TRUE(row["strength"].is_null());
}

TEST_F(ReadWorkTest, ALabelSaysWhatItReallyWas) {
  Label("V1", "f13");
  for (const WorkRow& row : Read()) {
    if (row.work.valve_id == "V1") {
      EXPECT_EQ(row.work.faults.at(0).fault, "f13");
      EXPECT_TRUE(row.work.faults[0].confirmed);
    }
  }
}

TEST_F(ReadWorkTest, ATrendIsAReasonOfItsOwn) {
  AddHealth("V9", 60);
  query_.since_ns = kDetected - 90 * kDay;
  query_.valve_glob = "V9";
  const auto rows = Read();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_THAT(rows[0].why, HasSubstr("limit F=-10%: limit in 4"));
  EXPECT_NEAR(rows[0].work.travel_strokes, 60 * 24 * 10.0, 1e-6);
  EXPECT_NEAR(rows[0].work.service_hours, 60 * 24.0, 1e-6);
}

TEST_F(ReadWorkTest, AFigureBeyondItsLimitIsAReason) {
  HealthHour hour;
  hour.valve_id = "V9";
  hour.hour = kDetected / (kDay / 24);
  hour.seen_ms = 3'600'000;
  hour.counts.turns = 10;
  hour.counts.dead_band = 14'000;  // 1.4 % each.
  hour.counts.slips = 1;           // No more than chance.
  hour.counts.slip_size = 5'000;
  Checkpoint checkpoint;
  checkpoint.health = {hour};
  writer_.CommitCheckpoint(checkpoint);
  query_.valve_glob = "V9";

  const auto rows = Read();

  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0].why,
            "Dead band of the valve: 1.40 % of travel over the last day, "
            "accepted up to 1.00");
  const auto json = WorkListReport(rows).document["rows"][0];
  EXPECT_EQ(json["namur"], "maintenance required");
  EXPECT_EQ(json["discipline"], "mechanical");
  EXPECT_TRUE(json["fault"].is_null());
  query_.discipline = "mechanical";
  EXPECT_EQ(Read().size(), 1u);
  query_.discipline = "air";
  EXPECT_TRUE(Read().empty());
}

TEST_F(ReadWorkTest, WhatIsShelvedIsLeftOutUntilTheShelfEnds) {
  storage::HistoryEditor(directory_.path() / "history.db")
      .Shelve("V1", std::nullopt, query_.options.now_ns + kDay,
              By("anna", query_.options.now_ns));
  EXPECT_EQ(Read().size(), 2u);
  query_.options.now_ns += 2 * kDay;
  EXPECT_EQ(Read().size(), 3u);
}

TEST_F(ReadWorkTest, TopAndDisciplineNarrowIt) {
  query_.top = 1;
  EXPECT_EQ(Read().size(), 1u);
  query_.top = 0;
  query_.discipline = "instrument";
  EXPECT_EQ(Read().size(), 2u);
  query_.discipline = "air";
  EXPECT_TRUE(Read().empty());
}

TEST_F(ReadWorkTest, CsvQuotesWhatNeedsIt) {
  std::ostringstream csv;
  WorkListReport(Read()).PrintCsv(csv);
  EXPECT_THAT(csv.str(), HasSubstr("rank,valve_id,score,severity"));
  EXPECT_THAT(csv.str(),
              HasSubstr(",\"Valve does not close, travel blocked: "));
}

}  // namespace
}  // namespace fdi::planner
