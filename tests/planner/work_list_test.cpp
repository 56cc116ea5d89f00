#include "planner/work_list.h"

#include <algorithm>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "planner/work_report.h"
#include "report/shared_files.h"
#include "storage/history/history_editor.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"
#include "tests/html_check.h"
#include "tests/storage/history_fixture.h"

namespace fdi::planner {
namespace {

using report::Json;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr std::int64_t kDay = 86'400'000'000'000;

const report::FaultTexts& Texts() {
  static const report::FaultTexts texts(report::SharedFile("faults.toml"));
  return texts;
}

class WorkListTest : public storage::HistoryFixture {
 protected:
  WorkListTest() : writer_(path_) {
    query_.now_ns = kDetected + kDay;
    query_.since_ns = kDetected - kDay;
    query_.limits = DefaultLimits();
    query_.software = "1.0";
  }

  Json List() {
    storage::HistoryReader reader(path_);
    return WorkList(&reader, Texts(), query_);
  }
  Json Rows() { return List()["rows"]; }
  std::string Html() {
    std::ostringstream html;
    WorkListPage(List()).PrintHtml(html, kListTitle, {true, true});
    return html.str();
  }
  void Label(const std::string& valve, const std::string& label) {
    storage::HistoryEditor(path_).Label(storage::EpisodeIdText(Id(valve)),
                                        label, By("anna", kDetected + kSecond));
  }
  // A fault that stands.
  void RecordOpen(const std::string& valve, FaultSet faults) {
    writer_.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
        kDetected);
    writer_.Record(Event(TransitionKind::kIsolated, 20, faults, 0.8,
                         EndReason::kNone, valve),
                   kDetected);
  }
  // A day with `live_h` hours judged and `other_h` in another quality.
  void Judge(const std::string& valve, int live_h, int other_h = 0,
             Quality other = Quality::kUncovered) {
    CoverageDay day{valve, kDetected / kDay, 1.0, {}};
    day.samples.Add(Quality::kLive, 3600 * live_h);
    day.samples.Add(other, 3600 * other_h);
    Checkpoint checkpoint;
    checkpoint.coverage = {day};
    writer_.CommitCheckpoint(checkpoint);
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

TEST_F(WorkListTest, EmptyHistoryIsSaidToBeEmpty) {
  const Json list = List();
  EXPECT_EQ(list["as_of_utc"], "2026-11-21T14:56:11Z");
  EXPECT_EQ(list["coverage"]["loops"], 0);
  EXPECT_TRUE(list["rows"].empty());
  EXPECT_TRUE(list["changes"].is_null());
  EXPECT_THAT(Html(), AllOf(HasSubstr("No loop is known"),
                            HasSubstr("Nothing was judged"),
                            HasSubstr("There is no earlier list")));
}

TEST_F(WorkListTest, ARowHasItsFactorsAndWhoSawIt) {
  RecordEpisode(writer_, 0b100, "FV-1");  // f19
  storage::HistoryEditor(path_).Acknowledge("last", By("anna", kDetected));
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  const Json& row = rows[0];
  EXPECT_EQ(row["rank"], 1);
  EXPECT_EQ(row["kind"], "episode");
  EXPECT_EQ(row["valve_id"], "FV-1");
  EXPECT_EQ(row["fault"], "f19");
  EXPECT_EQ(row["name"], "Flow transmitter wrong");
  EXPECT_EQ(row["severity"], "high");
  EXPECT_EQ(row["severity_points"], 4.0);
  EXPECT_EQ(row["grade"], nullptr);
  EXPECT_EQ(row["certainty"], "likely");
  EXPECT_NEAR(row["score"].get<double>(), 4.0 * row["confidence"].get<double>(),
              1e-5);
  EXPECT_EQ(row["acked_by"], "anna");
  EXPECT_EQ(row["open"], false);
  EXPECT_THAT(row["check"].get<std::string>(), Not(IsEmpty()));
  EXPECT_THAT(
      row["why"].get<std::string>(),
      AllOf(testing::StartsWith("Flow transmitter wrong: returned 24 h ago"),
            HasSubstr("severity high")));
}

TEST_F(WorkListTest, WhatStandsIsAboveWhatHasEnded) {
  RecordEpisode(writer_, 0b100, "A");  // high
  query_.loops = {{"A", {1}}};
  AddHealth("C", 60);
  query_.since_ns = kDetected - 90 * kDay;
  const Json rows = Rows();
  ASSERT_GE(rows.size(), 2u);
  EXPECT_EQ(rows[0]["valve_id"], "C");
  EXPECT_EQ(rows.back()["valve_id"], "A");
  EXPECT_GT(rows.back()["score"].get<double>(), rows[0]["score"].get<double>());
}

TEST_F(WorkListTest, GradeMovesALoopUpOrDown) {
  for (const char* valve : {"A", "B", "C"}) {
    RecordEpisode(writer_, 0b100, valve);
  }
  query_.loops = {{"A", {3}}, {"C", {1}}};
  query_.loops[1].about.description = "Feed to column C-101";
  query_.loops[1].about.location = "Hall 2";
  std::ostringstream text;
  WorkListReport(List()).PrintText(text, {});
  EXPECT_THAT(text.str(), HasSubstr("\n   Feed to column C-101, Hall 2\n"));
  EXPECT_THAT(Html(), HasSubstr("C: Feed to column C-101, Hall 2"));
  const Json rows = Rows();
  EXPECT_EQ(rows[0]["about"]["location"], "Hall 2");
  EXPECT_EQ(rows[1]["about"], nullptr);
  EXPECT_EQ(rows[0]["valve_id"], "C");
  EXPECT_EQ(rows[1]["valve_id"], "B");
  EXPECT_EQ(rows[2]["valve_id"], "A");
  EXPECT_DOUBLE_EQ(rows[0]["score"].get<double>(),
                   4.0 * rows[2]["score"].get<double>());
}

TEST_F(WorkListTest, FalseAlarmsAreNoRowsAndCostTrust) {
  RecordEpisode(writer_, 0b100, "V1");
  RecordEpisode(writer_, 0b100, "V3");
  const double before = Rows()[1]["score"];
  Label("V1", "false");
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["valve_id"], "V3");
  EXPECT_NEAR(rows[0]["score"].get<double>(), before / 2.0, 1e-5);
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr("labels called this answer wrong before"));
}

TEST_F(WorkListTest, WhereOnlyTheDataEndedTheFaultStands) {
  RecordOpen("V4", 4);
  writer_.Record(
      Event(TransitionKind::kClosed, 60, 4, 0.8, EndReason::kStreamEnded, "V4"),
      kDetected);
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["open"], true);
  EXPECT_EQ(rows[0]["unconfirmed_utc"], "2026-11-20T14:57:11Z");
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr("stands for 24 h, not confirmed for 24 h"));
  query_.now_ns = kDetected + 80 * kSecond;
  EXPECT_THAT(
      Rows()[0]["why"].get<std::string>(),
      HasSubstr("stands for 1 min, not confirmed for less than a minute"));
}

// A mere detection is not "unlike any known fault", nor of strength 0.
TEST_F(WorkListTest, WhatHasNoNameYetIsSaidSo) {
  writer_.Record(
      Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "V4"),
      kDetected);
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              testing::StartsWith("Fault without a name yet: "));
  EXPECT_TRUE(rows[0]["fault"].is_null());
  EXPECT_TRUE(rows[0]["strength"].is_null());
}

TEST_F(WorkListTest, ALabelSaysWhatItReallyWas) {
  RecordOpen("V1", 0b100);
  Label("V1", "f13");
  const Json row = Rows().at(0);
  EXPECT_EQ(row["fault"], "f13");
  EXPECT_EQ(row["name"], Texts().Of(13).name);
  EXPECT_EQ(row["confirmed"], true);
  EXPECT_EQ(row["confidence"], 1.0);
}

// The alarm is the same in every view: a label leaves its severity.
TEST_F(WorkListTest, ALabelDoesNotChangeTheSeverityOfTheAlarm) {
  RecordOpen("V1", 0b100);
  const std::string before = Rows().at(0)["severity"];
  ASSERT_NE(SeverityName(Texts().Words("f5", 1.0).severity), before);
  Label("V1", "f5");
  EXPECT_EQ(Rows().at(0)["fault"], "f5");
  EXPECT_EQ(Rows().at(0)["severity"], before);
}

// As in the list of alarms, until somebody says which of them it is.
TEST_F(WorkListTest, WhatLooksTheSameIsNamedBesideTheFault) {
  models_.faults = {1, 6, 19};
  RecordOpen("V1", 0b010);
  EXPECT_EQ(Rows().at(0)["look_alikes"], Json({"f18"}));
  EXPECT_THAT(
      Rows()[0]["why"].get<std::string>(),
      testing::StartsWith("Valve leaks through when shut or Bypass open: "));
  EXPECT_THAT(Html(), HasSubstr("Valve leaks through when shut (f6), or f18"));
  Label("V1", "f6");
  EXPECT_EQ(Rows().at(0)["look_alikes"], Json::array());
  EXPECT_THAT(Rows()[0]["why"].get<std::string>(),
              testing::StartsWith("Valve leaks through when shut: "));
}

TEST_F(WorkListTest, WhatIsLabelledAndOverIsDone) {
  RecordEpisode(writer_, 0b100, "V1");
  RecordOpen("V2", 0b100);
  Label("V2", "f19");
  Label("V1", "f19");
  const Json list = List();
  ASSERT_EQ(list["rows"].size(), 1u);
  EXPECT_EQ(list["rows"][0]["valve_id"], "V2");  // It stands.
  ASSERT_EQ(list["done"].size(), 1u);
  EXPECT_EQ(list["done"][0]["valve_id"], "V1");
  EXPECT_EQ(list["done"][0]["fault"], "f19");
  EXPECT_EQ(list["done"][0]["who"], "anna");
  EXPECT_EQ(list["done"][0]["what"], "labelled f19");
  EXPECT_THAT(Html(), HasSubstr("Done, and watched for their return"));
}

TEST_F(WorkListTest, ARepairIsDoneUntilTheFaultComesBack) {
  RecordEpisode(writer_, 0b100, "V1");
  RecordOpen("V2", 0b100);
  query_.repairs = {{"V*", kDetected + 200 * kSecond, "bo", "recalibrated"},
                    {"X", kDetected + 300 * kSecond, "bo", "replaced"}};
  Json list = List();
  ASSERT_EQ(list["rows"].size(), 1u);
  EXPECT_EQ(list["rows"][0]["valve_id"], "V2");
  EXPECT_THAT(list["rows"][0]["why"].get<std::string>(),
              HasSubstr("; still, 24 h after it was recalibrated"));
  EXPECT_EQ(list["done"][0]["what"], "recalibrated");

  FaultEvent again = Event(TransitionKind::kIsolated, 4 * 86'400, 0b100, 0.8,
                           EndReason::kNone, "V1");
  again.episode_id = 77;
  again.transition.detection_stamp_ns = again.transition.stamp_ns;
  writer_.Record(again, kDetected);
  query_.now_ns = kDetected + 5 * kDay;
  list = List();
  ASSERT_EQ(list["rows"].size(), 2u);
  const Json& row = list["rows"][0];
  EXPECT_EQ(row["valve_id"], "V1");
  EXPECT_EQ(row["episodes"], 1);
  EXPECT_EQ(row["done_utc"], "2026-11-20T14:59:31Z");
  EXPECT_THAT(row["why"].get<std::string>(),
              HasSubstr("; again, 4 days after it was recalibrated"));
  EXPECT_TRUE(list["done"].empty());
}

TEST_F(WorkListTest, WhatIsInWorkStaysWithItsOrderUntilItIsDone) {
  RecordOpen("V1", 0b100);
  AddHealth("V1", 60);
  query_.since_ns = kDetected - 90 * kDay;
  Repair order{"V1", kDetected + 3600 * kSecond, "bo", "ordered"};
  order.ordered = true;
  order.order = "4711";
  order.expected_ns = kDetected + 3 * kDay;
  query_.repairs = {order};
  Json rows = Rows();
  ASSERT_EQ(rows.size(), 3u);  // Its fault, a trend and a drift.
  for (const Json& row : rows) {
    EXPECT_EQ(row["order"], "4711");
    EXPECT_EQ(row["in_work_utc"], "2026-11-20T15:56:11Z");
    EXPECT_EQ(row["expected_utc"], "2026-11-23T14:56:11Z");
    EXPECT_EQ(row["done_utc"], nullptr);
    EXPECT_THAT(
        row["why"].get<std::string>(),
        HasSubstr("; in work for 23 h, order 4711, expected back in 2 days"));
  }
  query_.now_ns = kDetected + 5 * kDay;
  EXPECT_THAT(Rows()[0]["why"].get<std::string>(),
              HasSubstr("was expected back 2 days ago"));
  query_.repairs.push_back({"V*", kDetected + 4 * kDay, "bo", "recalibrated"});
  rows = Rows();
  ASSERT_EQ(rows.size(), 3u);
  for (const Json& row : rows) {
    EXPECT_EQ(row["order"], nullptr);
    EXPECT_EQ(row["done_utc"].is_string(), row["kind"] == "episode");
  }
}

// A repair before the first episode was about something else.
TEST_F(WorkListTest, AnAlarmWhoseDataEndedIsDoneByARepairAfterThat) {
  RecordOpen("V4", 4);
  writer_.Record(
      Event(TransitionKind::kClosed, 60, 4, 0.8, EndReason::kStreamEnded, "V4"),
      kDetected);
  for (const auto& [second, rows] : {std::pair(-10, 1u), {50, 1u}, {70, 0u}}) {
    query_.repairs = {{"V4", kDetected + second * kSecond, "bo", "repacked"}};
    EXPECT_EQ(Rows().size(), rows) << second;
  }
}

TEST_F(WorkListTest, ARowSaysWhatNamedItAndWeighsHowSureItIs) {
  FaultEvent event =
      Event(TransitionKind::kIsolated, 20, 0b100, 0.95, EndReason::kNone, "V1");
  event.transition.layer = Layer::kPhysics;
  writer_.Record(
      Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "V1"),
      kDetected);
  writer_.Record(event, kDetected);
  writer_.Record(
      Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "V2"),
      kDetected);
  const Json rows = Rows();
  EXPECT_EQ(rows[0]["layer"], "physics");
  EXPECT_EQ(rows[0]["certainty"], "sure");
  EXPECT_EQ(rows[0]["confidence"], 1.0);
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr("named by simulation of the valve"));
  EXPECT_EQ(rows[1]["certainty"], "not yet");
  EXPECT_EQ(rows[1]["confidence"], 0.25);
}

TEST_F(WorkListTest, WhatTheAuditSaysOfAnEpisodeIsNoSecondRow) {
  RecordOpen("L1", 0b010);  // f7: the process, not the valve.
  query_.audits.windows = {{"L1",
                            "no_response",
                            true,
                            "X stands at 0 %",
                            {},
                            kDetected,
                            kDetected + kDay},
                           {"L1",
                            "no_response",
                            true,
                            "X stood at 0 %",
                            {},
                            kDetected - 2 * kDay,
                            kDetected - kDay}};
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 2u);
  const auto of = [&rows](const char* kind) {
    return *std::ranges::find_if(
        rows, [kind](const Json& row) { return row["kind"] == kind; });
  };
  EXPECT_THAT(of("episode")["why"].get<std::string>(),
              AllOf(HasSubstr("the audit of its loop says: "),
                    HasSubstr("X stands at 0 %")));
  EXPECT_EQ(of("episode")["certainty"], "one of");
  EXPECT_EQ(of("episode")["confidence"], 0.5);
  EXPECT_THAT(of("audit")["why"].get<std::string>(),
              HasSubstr("X stood at 0 %"));
}

// Until the observers found more, the audit alone had an alarm.
TEST_F(WorkListTest, WhatTookOverFromTheAuditIsOneRow) {
  models_.faults.push_back(kStiction);
  for (const TransitionKind kind :
       {TransitionKind::kDetected, TransitionKind::kIsolated,
        TransitionKind::kClosed}) {
    const bool closed = kind == TransitionKind::kClosed;
    FaultEvent event =
        Event(kind, closed ? 60 : 10, 0b1000, 1.0,
              closed ? EndReason::kSuperseded : EndReason::kNone, "L1");
    event.transition.layer = Layer::kAudit;
    event.transition.detection_stamp_ns = kDetected - kSecond;
    event.episode_id = 77;
    writer_.Record(event, kDetected);
  }
  RecordOpen("L1", 0b100);  // f19, which leaves the rod alone.
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["fault"], "f19");
  EXPECT_EQ(rows[0]["witness"], "the audit of its loop says: the valve sticks");
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr("the audit of its loop says: the valve sticks"));
  EXPECT_EQ(rows[0]["certainty"], "one of");
}

TEST_F(WorkListTest, ATrendIsARowOfItsOwn) {
  RecordOpen("V9", 0b100);
  AddHealth("V9", 60);
  query_.since_ns = kDetected - 90 * kDay;
  const Json rows = Rows();
  const auto is_limit = [](const Json& each) {
    return each["kind"] == "limit";
  };
  ASSERT_EQ(std::ranges::count_if(rows, is_limit), 1);
  ASSERT_GE(rows.size(), 2u);  // The episode is one, too.
  const Json& row = *std::ranges::find_if(rows, is_limit);
  EXPECT_EQ(row["kind"], "limit");
  EXPECT_THAT(row["why"].get<std::string>(),
              HasSubstr("limit F=-10%: limit in 4"));
  EXPECT_EQ(row["trend"]["answer"], "time");
  EXPECT_NEAR(row["confidence"].get<double>(),
              1.0 - row["trend"]["days"].get<double>() / 180.0, 1e-4);
  EXPECT_NEAR(row["travel_strokes"].get<double>(), 60 * 24 * 10.0, 1e-6);
  EXPECT_NEAR(row["service_hours"].get<double>(), 60 * 24.0, 1e-6);
}

TEST_F(WorkListTest, AFigureBeyondItsLimitIsARow) {
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
  query_.now_ns = kDetected + kDay / 2;

  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["why"],
            "Dead band of the valve: 1.40 % of travel over the last day, "
            "accepted up to 1.00");
  EXPECT_EQ(rows[0]["namur"], "maintenance required");
  EXPECT_EQ(rows[0]["discipline"], "mechanical");
  EXPECT_TRUE(rows[0]["fault"].is_null());
  query_.now_ns = kDetected + 5 * kDay;
  EXPECT_THAT(Rows()[0]["why"].get<std::string>(),
              HasSubstr(", not confirmed for 5 days"));
  query_.discipline = "mechanical";
  EXPECT_EQ(Rows().size(), 1u);
  query_.discipline = "air";
  EXPECT_TRUE(Rows().empty());
  query_.discipline = "plumber";
  EXPECT_THROW(Rows(), ConfigError);
}

TEST_F(WorkListTest, ManySingleReadingsAreARowOfTheInstrument) {
  HealthHour hour;
  hour.valve_id = "V9";
  hour.hour = kDetected / (kDay / 24);
  hour.seen_ms = 2 * 3'600'000;
  hour.counts.single_x = 4;
  hour.counts.single_f = 20;
  Checkpoint checkpoint;
  checkpoint.health = {hour};
  checkpoint.health.front().counts.single_f = 1;
  writer_.CommitCheckpoint(checkpoint);
  query_.now_ns = kDetected + kDay / 2;
  EXPECT_TRUE(Rows().empty());

  checkpoint.health = {hour};
  writer_.CommitCheckpoint(checkpoint);
  const Json rows = Rows();
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_EQ(rows[0]["why"],
            "Noisy transmitter or wiring: 21 single readings of F in 4 h, "
            "accepted up to 2.00 an hour");
  EXPECT_EQ(rows[0]["severity"], "low");
  EXPECT_EQ(rows[0]["discipline"], "instrument");
}

TEST_F(WorkListTest, WhatIsShelvedIsLeftOutUntilTheShelfEnds) {
  RecordEpisode(writer_, 0b100, "A");
  storage::HistoryEditor(path_).Shelve("A", std::nullopt, query_.now_ns + kDay,
                                       By("bo", query_.now_ns, "ordered"));
  const Json list = List();
  EXPECT_TRUE(list["rows"].empty());
  ASSERT_EQ(list["shelved"].size(), 1u);
  EXPECT_EQ(list["shelved"][0]["who"], "bo");
  query_.now_ns += 2 * kDay;
  EXPECT_EQ(Rows().size(), 1u);
}

TEST_F(WorkListTest, LoopsOfOneCauseSayWhatTheyShare) {
  for (const char* valve : {"A", "B", "C"}) {
    RecordOpen(valve, 0b010);
  }
  storage::Transaction transaction(writer_.database());
  writer_.database().Run(
      "INSERT INTO common_cause VALUES ('000000000000000c', 'air header', ?, "
      "NULL)",
      kDetected);
  for (const char* valve : {"A", "B"}) {
    writer_.database().Run(
        "INSERT INTO common_cause_member VALUES ('000000000000000c', ?, ?, "
        "'f7', ?)",
        storage::EpisodeIdText(Id(valve)), std::string(valve), kDetected);
  }
  transaction.Commit();
  const Json list = List();
  ASSERT_EQ(list["rows"].size(), 3u);
  EXPECT_EQ(list["rows"][0]["shares"], "cause: air header");
  EXPECT_EQ(list["rows"][1]["shares"], "cause: air header");
  EXPECT_EQ(list["rows"][2]["shares"], nullptr);
  EXPECT_EQ(list["shared"][0]["faults"], Json::array({"f7"}));
  EXPECT_EQ(list["shared"][0]["valve_ids"], Json::array({"A", "B"}));
}

TEST_F(WorkListTest, AuditsAreRowsAndShareAPeriod) {
  query_.audits.windows = {
      {"L1", "stiction", true, "two witnesses", 2.5, kDetected, kDetected},
      {"L2", "external", false, "a sine", {}, kDetected, kDetected},
      {"L3", "undetermined", false, "nothing", {}, kDetected, kDetected},
      {"L4", "tuning", false, "regular", {}, kDetected, kDetected}};
  query_.audits.periods = {{42.0, {"L1", "L2"}}};
  const Json list = List();
  ASSERT_EQ(list["rows"].size(), 3u);
  EXPECT_EQ(list["rows"][0]["valve_id"], "L1");
  EXPECT_EQ(list["rows"][0]["shares"], "period: 42 s");
  EXPECT_EQ(list["rows"][0]["fault"], "stiction");
  EXPECT_DOUBLE_EQ(list["rows"][0]["score"].get<double>(), 2.0);
  EXPECT_EQ(list["coverage"]["audit"], 4);
}

// The list of a plant whose service was not started yet.
TEST_F(WorkListTest, WhatOnboardingFoundIsARowUntilTheLoopIsJudged) {
  const auto models = path_.parent_path() / "models.db";
  {
    storage::ModelStore store(models, storage::Access::kOccasionalWriter);
    const auto put = [&store](const char* name, const char* finding,
                              storage::LoopState state) {
      storage::PlantLoop loop;
      loop.name = name;
      loop.watch = storage::LoopWatch::kAudit;
      loop.state = state;
      loop.finding = finding;
      storage::ValveEntry entry;
      entry.pattern = name;
      store.PutLoop(loop, entry);
    };
    using enum storage::LoopState;
    put("F1", "no_response: OP is at an end; no sp", kDataOnly);
    put("F2", "stiction, sure, band 2.00 % of OP: X stays, then jumps",
        kDataOnly);
    put("F3", "undetermined: nothing stands out", kDataOnly);
    put("F4", "not judged: at most 3 samples in a row", kDataOnly);
    put("F5", "no_response: of an earlier record", kOnboarded);
  }
  const std::int64_t checked =
      storage::ModelStore(models).Loops()[0].checked_ns;
  query_.loops = LoopsOf(models);
  query_.now_ns = checked + 2 * kDay;
  query_.since_ns = checked - kDay;

  const Json list = List();
  const Json& rows = list["rows"];
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["valve_id"], "F1");
  EXPECT_EQ(rows[0]["fault"], "no_response");
  EXPECT_EQ(rows[0]["certainty"], "likely");
  EXPECT_THAT(rows[0]["why"].get<std::string>(),
              HasSubstr(": OP is at an end; no sp; so says its record"));
  EXPECT_EQ(rows[1]["fault"], "stiction");
  EXPECT_EQ(rows[1]["certainty"], "sure");
  EXPECT_EQ(list["coverage"]["nothing"], 5) << "a record is not watched";

  query_.valve_glob = "F2";
  EXPECT_EQ(Rows().size(), 1U);
  query_.valve_glob = "*";
  query_.repairs = {{"F2", query_.loops[1].verdict->end_ns, "bo", "repacked"}};
  EXPECT_EQ(Rows().size(), 1U);
  EXPECT_EQ(List()["done"][0]["what"], "repacked");
  CoverageDay day{"F1", checked / kDay + 1, 1.0, {}};
  day.samples.Add(Quality::kLive, 3600);
  Checkpoint checkpoint;
  checkpoint.coverage = {day};
  writer_.CommitCheckpoint(checkpoint);
  EXPECT_TRUE(Rows().empty());
  query_.repairs.clear();
  query_.since_ns = checked + kDay;
  EXPECT_TRUE(Rows().empty()) << "it was before the period";
}

TEST_F(WorkListTest, WhatIsNotJudgedIsListedWithItsReason) {
  Judge("A", 20);
  Judge("B", 2, 20, Quality::kInhibited);
  Judge("C", 0, 5, Quality::kUnassigned);
  query_.loops = {{"D"}, {"E", {}, "PV is constant"}};
  query_.audits.skipped = {{"C", "too short"}};
  const Json list = List();
  EXPECT_EQ(
      list["coverage"],
      Json({{"loops", 5}, {"named_faults", 2}, {"audit", 0}, {"nothing", 3}}));
  const Json& unjudged = list["unjudged"];
  ASSERT_EQ(unjudged.size(), 4u);
  EXPECT_EQ(unjudged[0]["valve_id"], "B");
  EXPECT_EQ(unjudged[0]["reason"], "its loop was not in automatic");
  EXPECT_NEAR(unjudged[0]["judged_share"].get<double>(), 2.0 / 22.0, 1e-5);
  EXPECT_EQ(unjudged[1]["reason"],
            "it has no model set, and no window of its loop was judged; "
            "audit: too short");
  EXPECT_EQ(unjudged[2]["reason"], "no data came");
  EXPECT_EQ(unjudged[3]["reason"], "PV is constant");
}

// In the whole period, a week without data would hardly show.
TEST_F(WorkListTest, JudgedIsSaidOfTheLastWeek) {
  Judge("A", 20);
  query_.now_ns = kDetected + 30 * kDay;
  const Json list = List();
  EXPECT_EQ(list["judged_since_utc"], "2026-12-13T14:56:11Z");
  EXPECT_EQ(list["coverage"]["named_faults"], 0);
}

// The time judged is stored once a minute.
TEST_F(WorkListTest, WhatIsJudgedNowOrHasAnEpisodeIsWatchedFromTheBeginning) {
  RecordEpisode(writer_, 0b100, "A");
  query_.judged_now = {"B"};
  query_.loops = {{"C"}};
  const Json list = List();
  EXPECT_EQ(list["coverage"]["named_faults"], 2);
  ASSERT_EQ(list["unjudged"].size(), 1u);
  EXPECT_EQ(list["unjudged"][0]["valve_id"], "C");
}

TEST_F(WorkListTest, ChangesAreThoseSinceTheLastDocument) {
  RecordOpen("A", 0b100);
  Judge("A", 20);
  query_.last = List();
  query_.last_file = "last.json";
  EXPECT_TRUE(List()["changes"]["valves"].empty());

  Label("A", "false");
  RecordOpen("B", 0b100);
  query_.loops = {{"D"}};
  const Json changes = List()["changes"];
  EXPECT_EQ(changes["last_utc"], (*query_.last)["as_of_utc"]);
  EXPECT_EQ(changes["coverage"]["loops"], 1);
  ASSERT_EQ(changes["valves"].size(), 3u);
  EXPECT_EQ(changes["valves"][0]["valve_id"], "A");
  EXPECT_EQ(changes["valves"][0]["change"], "gone");
  EXPECT_EQ(changes["valves"][0]["before"], "Flow transmitter wrong, high");
  EXPECT_EQ(changes["valves"][1]["valve_id"], "B");
  EXPECT_EQ(changes["valves"][1]["change"], "new");
  EXPECT_EQ(changes["valves"][2]["valve_id"], "D");
  EXPECT_EQ(changes["valves"][2]["change"], "no longer judged");

  (*query_.last)["rows"][0]["severity_points"] = "many";
  EXPECT_THROW(List(), DataError);
  query_.last = {{"rows", 1}};
  EXPECT_THROW(List(), DataError);
}

TEST_F(WorkListTest, AlarmsHaveTheirFigures) {
  RecordEpisode(writer_, 0b100, "A");
  writer_.AddGap({"", kDetected, kDetected + 10 * kSecond, "monitor_down"});
  writer_.Commit(kDetected);
  Label("A", "f19");
  const Json alarms = List()["alarms"];
  EXPECT_EQ(alarms["valves"][0]["episodes"], 1);
  EXPECT_EQ(alarms["faults"][0]["right"], 1);
  EXPECT_EQ(alarms["labelled"]["true"], 1);
  EXPECT_EQ(alarms["days"][0]["day_utc"], "2026-11-20");
  EXPECT_EQ(alarms["gaps"], 1);
  EXPECT_EQ(alarms["gaps_s"], 10.0);
  EXPECT_THAT(Html(), HasSubstr("1 labelled as a fault"));
}

TEST_F(WorkListTest, PageIsWellFormedWhateverPeopleWrote) {
  const std::string bad = "<script>alert('&\")</script>";
  RecordEpisode(writer_, 0b100, bad);
  storage::HistoryEditor editor(path_);
  editor.Acknowledge("last", By("<b>anna", kDetected));
  editor.Shelve(bad, "f7", query_.now_ns + kDay,
                By("bo", kDetected, "</table><img src=x onerror=y>"));
  query_.audits.skipped = {{"<i>", "</td>"}};
  const std::string html = Html();
  EXPECT_THAT(html,
              AllOf(Not(HasSubstr("<script")), Not(HasSubstr("<img")),
                    Not(HasSubstr("<b>")), HasSubstr("&lt;script&gt;"),
                    HasSubstr("size:A4 landscape"), HasSubstr("@media print"),
                    HasSubstr("prefers-color-scheme:dark")));
  EXPECT_THAT(MalformedTags(html), IsEmpty());
}

TEST_F(WorkListTest, WithoutHistoryTheAuditAndThePlantRemain) {
  query_.loops = {{"D", 2}};
  query_.audits.windows = {
      {"L1", "no_response", false, "winds up", {}, kDetected}};
  const Json list = WorkList(nullptr, Texts(), query_);
  EXPECT_EQ(
      list["coverage"],
      Json({{"loops", 2}, {"named_faults", 0}, {"audit", 1}, {"nothing", 1}}));
  EXPECT_EQ(list["rows"][0]["severity"], "high");
}

TEST_F(WorkListTest, ValvesWithAnEntryOughtToBeThere) {
  const auto file = directory_.path() / "models.db";
  EXPECT_TRUE(LoopsOf(file).empty());
  {
    storage::ModelStore store(file, storage::Access::kOccasionalWriter);
    storage::ValveEntry entry;
    for (const char* pattern : {"FV-1", "FV-2*"}) {
      entry.pattern = pattern;
      store.PutValve(entry);
    }
  }
  const auto loops = LoopsOf(file);
  ASSERT_EQ(loops.size(), 1u);
  EXPECT_EQ(loops[0].valve_id, "FV-1");
}

TEST_F(WorkListTest, TextHasTheFirstRowsAndCsvAll) {
  RecordEpisode(writer_, 0b001, "V1");
  RecordEpisode(writer_, 0b100, "V2");
  const report::Report report = WorkListReport(List(), 1);
  std::ostringstream text;
  report::ReportStyle style;
  style.utc = true;
  report.PrintText(text, style);
  EXPECT_THAT(
      text.str(),
      AllOf(HasSubstr("as of"), HasSubstr("\n1. V"), HasSubstr("because "),
            HasSubstr("and 1 more (--rows 0)"), Not(HasSubstr("\n2. "))));
  std::ostringstream csv;
  report.PrintCsv(csv);
  EXPECT_THAT(csv.str(), AllOf(HasSubstr("rank,valve_id,kind,fault,name"),
                               HasSubstr("\n2,V"),
                               HasSubstr(",\"Valve does not close, travel "
                                         "blocked: ")));
}

}  // namespace
}  // namespace fdi::planner
