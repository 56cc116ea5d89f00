// Questions of a planner to fdi-store.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

#include "storage/runs/runs.h"
#include "tests/html_check.h"
#include "tests/programs/store/store_program_fixture.h"

namespace fdi::storage {
namespace {

using testing::HasSubstr;

class FdiStorePlannerTest : public FdiStoreTest {
 protected:
  // 40 days in which X leaves the model by 0.05 % a day.
  void KeepHealth() {
    HistoryWriter writer(path_);
    std::vector<HealthHour> hours;
    for (int i = 0; i < 24 * 40; ++i) {
      HealthHour hour;
      hour.valve_id = "V1";
      hour.hour = 480'000 + i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.channels = {{Signal::kX, -10}};
      const std::int64_t residual = 51LL * (i / 24) + (i * 37) % 41;
      hour.bins[7] = {{3600, 3600 * residual, 0, 3600 * 71'000}};
      hours.push_back(hour);
    }
    Checkpoint checkpoint;
    checkpoint.health = hours;
    writer.CommitCheckpoint(checkpoint);
  }
};

TEST_F(FdiStorePlannerTest, TrendGivesTimeAndInterval) {
  KeepHealth();
  const json trend = StoreJson("health --valve V1 --limit X=3")["trends"];
  ASSERT_EQ(trend.size(), 1u);
  EXPECT_EQ(trend[0]["answer"], "time");
  EXPECT_NEAR(trend[0]["days"].get<double>(), (3.0 - 1.97) / 0.05, 1.0);
  EXPECT_LE(trend[0]["lower_days"], trend[0]["days"]);
  EXPECT_GE(trend[0]["upper_days"], trend[0]["days"]);
  EXPECT_EQ(Store("health --valve V1 --limit Q=3").code, 2);
  EXPECT_EQ(Store("health --valve none --limit X=3").code, 5);
}

TEST_F(FdiStorePlannerTest, HealthIsShownByDayByHourAndAsCsv) {
  KeepHealth();
  EXPECT_GE(StoreJson("health --valve V1")["hours"].size(), 40u);
  const json hours = StoreJson("health --valve V1 --hourly")["hours"];
  ASSERT_EQ(hours.size(), 24u * 40u);
  EXPECT_NEAR(hours[0]["channels"][0]["mean"].get<double>(), 0.0, 0.05);
  EXPECT_THAT(Store("health --valve V1 --csv").out,
              HasSubstr("hour_utc,epoch,model_hash"));
}

TEST_F(FdiStorePlannerTest, StatusIsThatOfTheGravestFigureBeyondItsLimit) {
  {
    HistoryWriter writer(path_);
    HealthHour hour;
    hour.valve_id = "V2";
    hour.hour = 24 * 20'000;
    hour.seen_ms = 3'600'000;
    hour.counts.auto_ms = 1'800'000;
    hour.counts.limit_ms = 360'000;
    hour.counts.turns = 2;
    hour.counts.dead_band = 2'400;
    Checkpoint checkpoint;
    checkpoint.health = {hour};
    hour.hour += 24;
    hour.counts = {};
    checkpoint.health.push_back(hour);
    writer.CommitCheckpoint(checkpoint);
  }
  const json days = StoreJson("health --valve V2 --from 1970-01-01")["hours"];
  ASSERT_EQ(days.size(), 2u);
  EXPECT_EQ(days[0]["dead_band"], 1.2);
  EXPECT_EQ(days[0]["at_limit"], 10.0);
  EXPECT_EQ(days[0]["auto_h"], 0.5);
  EXPECT_TRUE(days[0]["t63"].is_null());
  EXPECT_EQ(days[0]["exceeded"], json({"at_limit", "dead_band"}));
  EXPECT_EQ(days[0]["status"], "out of specification");
  EXPECT_EQ(days[1]["status"], "good");
  EXPECT_THAT(Store("health --valve V2 --from 1970-01-01").out,
              HasSubstr("out of specification: at_limit, dead_band"));
}

TEST_F(FdiStorePlannerTest, WorkListOfAnEmptyHistoryIsEmpty) {
  { const HistoryWriter writer(path_); }
  EXPECT_TRUE(StoreJson("worklist")["rows"].empty());
  EXPECT_THAT(Store("worklist").out, HasSubstr("Nothing was judged: "));
  EXPECT_EQ(Store("worklist --discipline plumber").code, 2);
  const Outcome ignored = Store("worklist --monitor x");
  EXPECT_EQ(ignored.code, 2);
  EXPECT_THAT(ignored.err, HasSubstr("--db"));
  const Outcome report = Store("report --output .");
  EXPECT_EQ(report.code, 2);
  EXPECT_THAT(report.err, HasSubstr("report is gone: fdi-store worklist"));
}

// A day of which 20 h were judged, and a fault.
TEST_F(FdiStorePlannerTest, WorkListIsWrittenAsAPageAndCompared) {
  {
    HistoryWriter writer(path_);
    CoverageDay day{"LV-1", kDetected / (86'400 * kSecond), 1.0, {}};
    day.samples.Add(Quality::kLive, 72'000);
    Checkpoint checkpoint;
    checkpoint.coverage = {day};
    writer.CommitCheckpoint(checkpoint);
  }
  const std::string verb = "worklist --from 2026-11-01 --utc --html week.html";
  EXPECT_EQ(Store(verb).code, 0);
  const json first = json::parse(Slurp(directory_.path() / "week.json"));
  EXPECT_TRUE(first["changes"].is_null());
  {
    HistoryWriter writer(path_);
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
    writer.Record(Event(TransitionKind::kIsolated, 20, 0b100, 0.8), kDetected);
  }
  const json second = StoreJson(verb);
  EXPECT_EQ(second["changes"]["last_utc"], first["as_of_utc"]);
  EXPECT_EQ(second["changes"]["valves"][0]["change"], "new");
  EXPECT_EQ(json::parse(Slurp(directory_.path() / "week.json")), second);
  const std::string html = Slurp(directory_.path() / "week.html");
  EXPECT_THAT(html, HasSubstr("Flow transmitter wrong (f19)"));
  EXPECT_THAT(MalformedTags(html), testing::IsEmpty());
  EXPECT_THAT(Store(verb + " --csv").out,
              HasSubstr("\n1,LV-1,episode,f19,Flow transmitter wrong,high,4"));
}

// A row that stands becomes one order; one ordered, over or shelved none, nor a
// notice.
TEST_F(FdiStorePlannerTest, AWorkListBecomesRowsOfSapAndMaximo) {
  {
    HistoryWriter writer(path_);
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
    writer.Record(Event(TransitionKind::kIsolated, 20, 0b100, 0.8), kDetected);
    RecordEpisode(writer, 0b100, "LV-2");
    for (const FaultSet faults : {0b000, 0b100}) {
      FaultEvent notice = Event(
          faults == 0 ? TransitionKind::kDetected : TransitionKind::kIsolated,
          20, faults, 0.8, EndReason::kNone, "LV-3");
      notice.transition.notice = true;
      writer.Record(notice, kDetected);
    }
  }
  EXPECT_THAT(Store("worklist --from 2026-11-01 --csv").out,
              HasSubstr(",LV-3,notice,f19,"));
  const auto orders = [this](const std::string& form) {
    return Store(
        "worklist --from 2026-11-01 --csv --rows 0 2>/dev/null"
        " | python3 " FDI_WORK_ORDERS " " +
        form);
  };
  const std::string sap = orders("sap").out;
  EXPECT_THAT(sap, testing::StartsWith("NOTIF_TYPE,FUNCT_LOC,SHORT_TEXT,"));
  EXPECT_THAT(sap, HasSubstr("\nM2,LV-1,LV-1: Flow transmitter wrong,2,"
                             "20261120,145611,"));
  EXPECT_THAT(sap, testing::Not(HasSubstr("LV-2")));
  EXPECT_THAT(sap, testing::Not(HasSubstr("LV-3")));
  const json maximo = json::parse(orders("maximo").out);
  EXPECT_EQ(maximo["assetnum"], "LV-1");
  EXPECT_EQ(maximo["reportedpriority"], 2);
  EXPECT_EQ(maximo["reportdate"], "2026-11-20T14:56:11Z");
  EXPECT_EQ(maximo["externalrecid"], EpisodeIdText(Id()));
  ASSERT_EQ(Store("valves repaired LV-1 ordered --order 4711").code, 0);
  EXPECT_EQ(orders("sap").out, "");
}

TEST_F(FdiStorePlannerTest, WorkListRefusesWhatItCannotUse) {
  EXPECT_EQ(Store("worklist").code, 3);  // There is nothing at all.
  { const HistoryWriter writer(path_); }
  EXPECT_EQ(Store("worklist").code, 0);
  EXPECT_EQ(Store("worklist --from 2100-01-01").code, 2);
  EXPECT_EQ(Store("worklist --from soon").code, 2);
  const Outcome past = Store("worklist --stop 2020-01-01");
  EXPECT_EQ(past.code, 2);
  EXPECT_THAT(past.err, HasSubstr("--stop 2020-01-01 is not in the future"));
  EXPECT_EQ(Store("worklist --html no/such/week.html").code, 3);
  Write("week.json", "[1]");
  const Outcome foreign = Store("worklist --html week.html");
  EXPECT_EQ(foreign.code, 3);
  EXPECT_THAT(foreign.err, HasSubstr("week.json is no work list"));
  EXPECT_EQ(Slurp(directory_.path() / "week.json"), "[1]");
}

// A sticky loop without a model set or a history: X follows CV through a play.
TEST_F(FdiStorePlannerTest, WorkListAuditsStoredRunsIfAskedTo) {
  std::string rows = header_;
  double x = 50.0;
  for (int t = 0; t < 900; ++t) {
    const double cv = 50.0 + 4.0 * std::sin(0.05 * t);
    x = std::min(std::max(x, cv - 1.5), cv + 1.5);
    rows += std::to_string(t) + ',' + std::to_string(cv) + ",3500,2600,130," +
            std::to_string(x) + ',' + std::to_string(30.0 - 0.2 * x) + '\n';
  }
  Write("a.csv", rows);
  ASSERT_EQ(Store("runs import a.csv --valve FV-1").code, 0);
  const std::string verb = "worklist --from 2000-01-01";
  const json list = StoreJson(verb + " --audit-windows 3");
  EXPECT_EQ(list["coverage"]["audit"], 1);
  ASSERT_EQ(list["rows"].size(), 1u) << list.dump(1);
  EXPECT_EQ(list["rows"][0]["fault"], "stiction");
  EXPECT_EQ(StoreJson(verb)["coverage"]["audit"], 0);

  // Training data of the simulator are of no loop of the plant.
  {
    Database database(path_.parent_path() / "runs.db", RunsSchema(),
                      Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Prepare("UPDATE run SET origin = 'simulated'").Run();
    transaction.Commit();
  }
  EXPECT_EQ(StoreJson(verb + " --audit-windows 3")["coverage"]["loops"], 0);
}

}  // namespace
}  // namespace fdi::storage
