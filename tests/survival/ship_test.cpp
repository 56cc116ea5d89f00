// fdi-store ship against a real server: what is there is what is here, whoever
// was killed in between.
#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <random>
#include <regex>
#include <set>
#include <stop_token>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "plant/plant_reader.h"
#include "storage/history/history_reader.h"
#include "storage/history/retention.h"
#include "storage/history/valve_move.h"
#include "tests/storage/many_episodes.h"
#include "tests/survival/plant_fixture.h"

namespace fdi::storage {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

int Setting(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::atoi(text);
}

class ShipTest : public PlantFixture {
 protected:
  std::vector<std::string> ShipCommand(const std::string& folder,
                                       const std::string& every) const {
    return {"ship",        "--data",  (directory_.path() / folder).string(),
            "--db",        Url(),     "--monitor",
            folder,        "--every", every,
            "--log-level", "info"};
  }
  std::filesystem::path Log() const { return directory_.path() / "log"; }
  std::ptrdiff_t Count(const std::string& event) const {
    const std::string log = Slurp(Log());
    const std::regex word(event);
    return std::distance(std::sregex_iterator(log.begin(), log.end(), word),
                         std::sregex_iterator());
  }
  template <typename Condition>
  static void WaitUntil(Condition holds) {
    const auto end = Clock::now() + std::chrono::seconds(30);
    while (!holds()) {
      ASSERT_LT(Clock::now(), end);
      std::this_thread::sleep_for(milliseconds(10));
    }
  }
  static CoverageDay Coverage(std::uint64_t live) {
    CoverageDay day;
    day.valve_id = "V1";
    day.day = kDetected / 86'400'000'000'000;
    day.samples.Add(Quality::kLive, live);
    return day;
  }
  // Two hours, of which the second one travelled.
  static Checkpoint HoursOfHealth(const std::string& valve) {
    Checkpoint checkpoint;
    for (int i = 0; i < 2; ++i) {
      HealthHour& hour = checkpoint.health.emplace_back();
      hour.valve_id = valve;
      hour.hour = kDetected / 3'600'000'000'000 + i;
      hour.model_hash = 0x8000'0000'0000'0001;
      hour.seen_ms = 3'600'000;
      hour.live_ms = 1'800'000;
      hour.live_samples = 1800;
      hour.normal_factor = 900'000;
      hour.travel = 400'000 * i;
      hour.channels = {{Signal::kX, -10}};
      hour.bins[5] = {{1800, 3600, 14'400, 1'000'000}};
    }
    return checkpoint;
  }
  std::int64_t LoggedChanges(const std::string& folder,
                             const std::string& figure = "count(*)") const {
    return Database(directory_.path() / folder / "history.db", HistorySchema(),
                    Access::kReader)
        .QueryInt64("SELECT " + figure + " FROM change")
        .value_or(0);
  }
  static void Stop(pid_t program) {
    kill(program, SIGTERM);
    waitpid(program, nullptr, 0);
  }
};

// Every kind of change after the episode was shipped: what is there follows.
TEST_F(ShipTest, WhatChangesIsShippedAgain) {
  Init();
  const auto path = Folder("a") / "history.db";
  HistoryWriter writer(path);
  writer.BeginSession(kDetected, "test", "",
                      {{"f1", "Blocked"}, {"f7", "Flashing"}, {"f19", "F"}});
  std::int64_t last = 0;
  const auto follow = [&](const char* what) {
    const std::int64_t before = last;
    last = LoggedChanges("a", "max(number)");
    EXPECT_GT(last, before) << what;
    const Outcome outcome = Ship("a");
    ASSERT_EQ(outcome.code, 0) << what << ": " << outcome.err;
    SCOPED_TRACE(what);
    ExpectEqual("a");
    EXPECT_LE(LoggedChanges("a"), 1) << "the last one stays";
  };
  ASSERT_EQ(Ship("a").code, 0);

  using Kind = TransitionKind;
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  follow("detected");
  std::vector<TracePoint> points;
  for (int k = 0; k < 400; ++k) {
    points.push_back(Instant(k));
  }
  writer.AppendTrace(Id(), std::span(points).first(250));
  writer.Commit(kDetected + kSecond);
  follow("evidence");
  writer.AppendTrace(Id(), std::span(points).subspan(250));
  writer.Commit(kDetected + 2 * kSecond);
  follow("more of the same chunk, and another");
  writer.Record(Event(Kind::kIsolated, 20, 0b01, 0.8), kDetected);
  follow("isolated");
  writer.Record(Event(Kind::kReisolated, 30, 0b10, 0.9), kDetected);
  follow("isolated as another");
  writer.Record(Event(Kind::kReisolated, 35, 0, 0.9, EndReason::kNone, "LV-1"),
                kDetected);
  follow("isolated as unknown");
  writer.Resume(Id(), kDetected + 40 * kSecond, kDetected);
  follow("resumed");
  EpisodeLook look;
  look.episode_id = Id();
  look.first_ns = kDetected;
  look.period_ns = kSecond;
  look.faults = {{1, 0.5, 0.4, 0.6, kDetected, false},
                 {7, 0.2, 0.1, 0.3, kDetected, true}};
  look.rival = LookRival{3, 12.5};
  look.observers = {1, 7};
  look.x_pct = {1.0, 2.0};
  look.flow = {3.0, 4.0};
  writer.StoreLook(look);
  follow("a second look");
  look.rival.reset();
  look.faults.pop_back();
  look.x_pct = {5.0};
  look.flow = {6.0};
  writer.StoreLook(look);
  follow("a shorter one instead");
  StrengthPoint strength{Id(), kDetected, 7, 0.5, 0.4, 0.6, Layer::kPhysics};
  writer.StoreStrength(strength);
  follow("a strength");
  strength.stamp_ns += kSecond;
  writer.StoreStrength(strength);
  strength.strength = 0.45;
  writer.StoreStrength(strength);
  follow("a second one, and another instead");
  const auto change = [&path](const std::string& sql) {
    Database file(path, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(file);
    file.Run(sql);
    transaction.Commit();
  };
  change(
      "INSERT INTO common_cause VALUES ('000000000000000c', 'air', 5, NULL)");
  change("INSERT INTO common_cause_member VALUES ('000000000000000c', '" +
         EpisodeIdText(Id()) + "', 'LV-1', 'f7', 4)");
  follow("a common cause");
  const auto causes = PlantReader(Url(), "").OpenCauses();
  ASSERT_EQ(causes.size(), 1U);
  EXPECT_EQ(causes[0].group, "air");
  EXPECT_EQ(causes[0].members, HistoryReader(path).OpenCauses().at(0).members);
  change("UPDATE common_cause SET ended_ns = 9");
  follow("its end");
  EXPECT_TRUE(PlantReader(Url(), "").OpenCauses().empty());
  writer.Record(Event(Kind::kCleared, 90, 0b10, 0.1), kDetected);
  follow("cleared");
  writer.Record(Event(Kind::kClosed, 91, 0b10, 0.1, EndReason::kCleared),
                kDetected);
  follow("closed");
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3, EndReason::kNone, "lost"),
                kDetected);
  writer.Record(End(Id("lost"), kDetected + kSecond), kDetected);
  follow("ended by the next session");
  Checkpoint minute;
  minute.coverage.push_back(Coverage(60));
  minute.health.emplace_back();
  minute.health.back().valve_id = "V1";
  minute.health.back().hour = kDetected / 3'600'000'000'000;
  minute.health.back().live_ms = 60'000;
  writer.CommitCheckpoint(minute);
  follow("hours");
  writer.CommitCheckpoint(minute);
  follow("more of the same hours");
  writer.AddGap({"V1", kDetected, kDetected + kSecond, "test"});
  writer.Commit(kDetected + 20 * kSecond);
  follow("a gap, a sign of life");
  const auto shelf = HistoryEditor(path).Shelve(
      "V1", std::nullopt, kDetected + 3600 * kSecond, By("anna", kDetected));
  follow("shelved");
  HistoryEditor(path).EndShelf(shelf.shelf_id, By("anna", kDetected + kSecond));
  follow("taken off the shelf");
  writer.EndSession(kDetected + 30 * kSecond, true);
  follow("the session ended");
  writer.BeginSession(kDetected + 40 * kSecond, "test", "");
  follow("another one");
  {
    HistoryEditor editor(path);
    const std::string id = EpisodeIdText(Id());
    editor.Label(id, "f7", By("anna", kDetected));
    follow("labelled");
    editor.Acknowledge(id, By("anna", kDetected, "Tell the shift"));
    follow("acknowledged with a comment");
    editor.Acknowledge(id, By("bert", kDetected + 1,
                              "Gr\xfc\xdf"
                              "e"));
  }
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_EQ(PlantRowsOf("SELECT comment FROM fdi.episode_event "
                        "WHERE kind = 'ACK' ORDER BY stamp_ns"),
            (std::vector<std::string>{"|Tell the shift", "|Gr\\xfc\\xdfe"}));
}

// The log of changes costs nothing where it serves nobody.
TEST_F(ShipTest, ChangesAreLoggedForPlantsAlone) {
  Init();
  const auto path = Folder("a") / "history.db";
  HistoryWriter writer(path);
  RecordEpisode(writer, 0b01);
  EXPECT_EQ(LoggedChanges("a"), 0);
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_EQ(LoggedChanges("a"), 0) << "copied, not logged";
  RecordEpisode(writer, 0b10, "LV-2");
  EXPECT_EQ(LoggedChanges("a"), 5) << "one for each event, two for a name";

  // A second plant gets a copy of all, the first one what changed since.
  const std::string first = database_;
  server_->Create("second");
  database_ = "second";
  Init();
  ASSERT_EQ(Ship("a").code, 0);
  ExpectEqual("a");
  EXPECT_EQ(LoggedChanges("a"), 5) << "the first one does not have them";
  database_ = first;
  ASSERT_EQ(Ship("a").code, 0);
  ExpectEqual("a");
  EXPECT_EQ(LoggedChanges("a"), 1) << "both have them";

  // The plant is away for 11 000 minutes.
  server_->Stop();
  Checkpoint minutes;
  minutes.coverage.assign(11'000, Coverage(60));
  writer.CommitCheckpoint(minutes);
  EXPECT_EQ(LoggedChanges("a"), 11'001);
  EXPECT_EQ(Ship("a").code, 3);
  EXPECT_EQ(LoggedChanges("a"), 2) << "the last of each";
  server_->Start();
  ASSERT_EQ(Ship("a").code, 0);
  ExpectEqual("a");

  RecordEpisode(writer, 0b10, "LV-3");
  ASSERT_EQ(Store("ship --forget --data " + Folder("a").string()).code, 0);
  EXPECT_EQ(LoggedChanges("a"), 0);
  RecordEpisode(writer, 0b10, "LV-4");
  EXPECT_EQ(LoggedChanges("a"), 0);
  ASSERT_EQ(Ship("a").code, 0);
  ExpectEqual("a");
}

// Ships two histories into one plant, of which one is written meanwhile, with
// kill -9 of the server and of the programs at random moments; again, and
// nothing is new.
TEST_F(ShipTest, NothingIsLostOrTwiceWhoeverIsKilled) {
  Init();
  const int episodes = Setting("FDI_SHIP_EPISODES", 3000);
  const int kills = Setting("FDI_SHIP_KILLS", 3);
  GenerateEpisodes(Folder("a") / "history.db", episodes / 2, "aaaa");
  GenerateEpisodes(Folder("b") / "history.db", episodes - episodes / 2, "bbbb");
  std::mt19937 random(static_cast<unsigned>(Setting("FDI_KILL_SEED", 1)));
  const auto some = [&random](int most_ms) {
    std::this_thread::sleep_for(
        milliseconds(std::uniform_int_distribution<int>(0, most_ms)(random)));
  };
  pid_t a = Spawn(ShipCommand("a", "50ms"), Log());
  const pid_t b = Spawn(ShipCommand("b", "50ms"), Log());
  HistoryWriter writer(Folder("a") / "history.db");
  for (int i = 0; i < kills; ++i) {
    some(300);
    RecordEpisode(writer, 0b01, "LV-" + std::to_string(i));
    some(300);
    if (i % 2 == 0) {
      server_->Crash();
    }
    kill(a, SIGKILL);
    waitpid(a, nullptr, 0);
    some(200);
    a = Spawn(ShipCommand("a", "50ms"), Log());
    if (i % 2 == 0) {
      server_->Start();
    }
  }
  kill(a, SIGKILL);
  kill(b, SIGKILL);
  waitpid(a, nullptr, 0);
  waitpid(b, nullptr, 0);

  for (const char* folder : {"a", "b"}) {
    const Outcome outcome = Ship(folder);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(Ship(folder).out, HasSubstr("nothing was new"));
    ExpectEqual(folder);
  }
  EXPECT_EQ(PlantRowsOf("SELECT count(*) FROM fdi.fault_history"),
            std::vector{"|" + std::to_string(episodes + kills)});
}

// Two transactions of each side: what PostgreSQL does meanwhile is its own
// affair.
TEST_F(ShipTest, TheMonitorDoesNotWaitForPostgres) {
  Init();
  const auto path = Folder("a") / "history.db";
  HistoryWriter writer(path);
  RecordEpisode(writer, 0b01);
  ASSERT_EQ(Ship("a").code, 0);
  PlantDatabase blocker(Url());
  blocker.Run("BEGIN");
  blocker.Run("LOCK fdi.episode IN ACCESS EXCLUSIVE MODE");
  RecordEpisode(writer, 0b10, "LV-2");
  const pid_t shipper = Spawn(ShipCommand("a", "1h"), Log());
  WaitUntil([&] {
    return PlantRowsOf("SELECT count(*) FROM pg_locks WHERE NOT granted") !=
           std::vector<std::string>{"|0"};
  });

  // They would wait for ever: the lock is released only after them.
  RecordEpisode(writer, 0b10, "LV-3");
  EXPECT_TRUE(writer.database().Checkpoint());

  blocker.Run("COMMIT");
  WaitUntil([&] {
    return PlantRowsOf("SELECT count(*) FROM fdi.episode").front() == "|3";
  });
  Stop(shipper);
  ExpectEqual("a");
}

// Each reason once, and then it goes on where it was.
TEST_F(ShipTest, WhatIsWrongIsSaidOnce) {
  Init();
  HistoryWriter writer(Folder("a") / "history.db");
  const pid_t shipper = Spawn(ShipCommand("a", "20ms"), Log());
  RecordEpisode(writer, 0b01);
  WaitUntil([&] {
    return PlantRowsOf("SELECT count(*) FROM fdi.episode").front() == "|1";
  });
  server_->Stop();
  RecordEpisode(writer, 0b10, "LV-2");
  // It loses its connection, may be told of the shutdown or lose one that is
  // being made, and then gets none, after 20, 40, ... ms. From then on nothing
  // is new.
  WaitUntil([&] { return Count("No such file or directory") > 0; });
  std::this_thread::sleep_for(milliseconds(1000));
  EXPECT_LE(Count("ship_failed"), 4) << Slurp(Log());
  EXPECT_EQ(Count("No such file or directory"), 1);
  server_->Start();
  WaitUntil([&] { return Count("ship_goes_on") == 1; });
  Stop(shipper);
  ExpectEqual("a");
}

TEST_F(ShipTest, AHistoryThatIsRestoredIsShippedOn) {
  Init();
  const auto path = Folder("a") / "history.db";
  RecordEpisode(*std::make_unique<HistoryWriter>(path), 0b01);
  const pid_t shipper = Spawn(ShipCommand("a", "20ms"), Log());
  const auto wait_for = [&](const std::string& episodes) {
    WaitUntil([&] {
      return PlantRowsOf("SELECT count(*) FROM fdi.episode").front() ==
             "|" + episodes;
    });
  };
  wait_for("1");
  const auto backup = Folder("a") / "backup.db";
  Database(path, HistorySchema(), Access::kReader).BackupTo(backup);
  for (const char* rest : {"-wal", "-shm"}) {
    std::filesystem::remove(path.string() + rest);
  }
  std::filesystem::rename(backup, path);
  RecordEpisode(*std::make_unique<HistoryWriter>(path), 0b01, "LV-2");
  wait_for("2");
  Stop(shipper);
}

TEST_F(ShipTest, RefusalsHaveAReasonAndCode3) {
  HistoryWriter writer(Folder("a") / "history.db");
  RecordEpisode(writer, 0b01);
  const auto refused = [&](const Outcome& outcome, const std::string& reason) {
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.err, HasSubstr(reason));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
  };
  refused(Ship("a"), "has no schema fdi: run `fdi-store ship --init");
  Init();
  Init();  // Again: nothing happens.
  PlantDatabase owner(Url());
  owner.RunScript(
      "CREATE ROLE nobody LOGIN; CREATE ROLE room LOGIN IN ROLE fdi_writer;"
      "CREATE ROLE screen LOGIN IN ROLE fdi_reader");
  refused(Ship("a", "", "nobody"), "permission denied for schema fdi");
  refused(Ship("a", "", "screen"), "permission denied for table monitor");
  server_->Create("empty");
  refused(Store("ship --init --db '" + server_->Url("empty", "room") + "'"),
          "permission denied for database empty");
  EXPECT_EQ(Ship("a", "", "room").code, 0);
  refused(
      Store("prune --history-age 1s --trust-clock --db '" + Url("room") + "'"),
      "permission denied for table episode");
  EXPECT_EQ(Store("history list --db '" + Url("screen") + "'").code, 0);
  owner.Run("UPDATE fdi.plant SET version = version + 1");
  refused(Ship("a"),
          "schema fdi has version 13, this program needs 12: update "
          "this program");
  refused(Store("ship --data " + Folder("a").string() +
                " --db 'postgresql://x:secret@/plant?host=/nowhere'"),
          "No such file or directory");
  EXPECT_THAT(Store("ship --data " + Folder("a").string() +
                    " --db 'postgresql://x:secret@[/plant'")
                  .err,
              testing::Not(HasSubstr("secret")));
}

// PostgreSQL was restored from a backup; history.db was; the history is new.
TEST_F(ShipTest, BothSidesMayComeFromABackup) {
  Init();
  const auto path = Folder("a") / "history.db";
  PlantDatabase owner(Url());
  {
    HistoryWriter writer(path);
    RecordEpisode(writer, 0b01);
  }
  ASSERT_EQ(Ship("a").code, 0);
  owner.Run("DELETE FROM fdi.episode");
  owner.Run("UPDATE fdi.monitor SET shipped_ns = 1");
  ASSERT_EQ(Ship("a").code, 0);
  ExpectEqual("a");

  const auto backup = Folder("backup") / "history.db";
  Database(path, HistorySchema(), Access::kReader).BackupTo(backup);
  {
    HistoryWriter writer(path);
    RecordEpisode(writer, 0b01, "LV-2");
  }
  ASSERT_EQ(Ship("a").code, 0);
  std::filesystem::copy_file(backup, path,
                             std::filesystem::copy_options::overwrite_existing);
  {
    HistoryWriter writer(path);
    RecordEpisode(writer, 0b10, "LV-3");
  }
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_EQ(PlantRowsOf("SELECT valve_id FROM fdi.episode ORDER BY 1"),
            (std::vector<std::string>{"|LV-1", "|LV-2", "|LV-3"}));
}

// The rules of fdi-store prune; here it waits for the plant.
TEST_F(ShipTest, RetentionOfBothSides) {
  Init();
  const auto path = Folder("a") / "history.db";
  {
    HistoryWriter writer(path);
    for (const char* valve : {"old", "unacked", "labelled"}) {
      RecordEpisode(writer, 0b01, valve);
    }
    writer.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "open"),
        kDetected);
    for (const FaultEvent& event : writer.UnsentEvents()) {
      writer.MarkSent(event);
    }
    writer.Commit(kDetected);
    HistoryEditor editor(path);
    for (const char* valve : {"old", "labelled", "open"}) {
      editor.Acknowledge(EpisodeIdText(Id(valve)), By("anna", kDetected));
    }
    editor.Label(EpisodeIdText(Id("labelled")), "true", By("anna", kDetected));
  }
  RetentionLimits limits;
  limits.before_ns = kDetected + 86400 * kSecond;
  limits.dry_run = true;
  const auto deleted = [&] { return PruneHistory(path, limits).deleted; };
  EXPECT_EQ(deleted(), 1);
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_EQ(deleted(), 1);
  HistoryEditor(path).Acknowledge(EpisodeIdText(Id("old")),
                                  By("bert", kDetected + 1));
  EXPECT_EQ(deleted(), 0) << "the plant does not have the second note";
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_EQ(deleted(), 1);
  {
    Database history(path, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(history);
    history.Run("UPDATE ship_cursor SET copied_ns = ?, copied_valve = ''",
                kDetected - 1);
    transaction.Commit();
  }
  EXPECT_EQ(deleted(), 0) << "the plant does not have the first copy";
  ASSERT_EQ(Store("ship --forget --data " + Folder("a").string()).code, 0);
  limits.dry_run = false;
  EXPECT_EQ(deleted(), 1);
  ASSERT_EQ(Ship("a").code, 0);  // The plant keeps rows deleted here.

  PlantDatabase plant(Url());
  const auto there = [&](std::int64_t before_ns, bool dry_run = false) {
    const PlantPruned pruned = PrunePlantEpisodes(plant, before_ns, dry_run);
    return std::pair(pruned.deleted, pruned.kept);
  };
  const Outcome verb =
      Store("prune --history-age 36000d --db '" + Url() + "' --json");
  EXPECT_THAT(verb.out, AllOf(HasSubstr("\"deleted\": 0"),
                              HasSubstr("\"protected\": 3")));
  using Pair = std::pair<std::int64_t, std::int64_t>;
  EXPECT_EQ(there(kDetected + 60 * kSecond), Pair(0, 3));
  EXPECT_EQ(there(*limits.before_ns, true), Pair(1, 3));
  EXPECT_EQ(there(*limits.before_ns), Pair(1, 3));
  EXPECT_EQ(there(*limits.before_ns), Pair(0, 3));
  for (const char* table : {"episode", "episode_fault", "episode_event"}) {
    EXPECT_EQ(
        PlantRowsOf(std::string("SELECT count(*) FROM fdi.") + table +
                    " WHERE episode_id = '" + EpisodeIdText(Id("old")) + "'"),
        std::vector<std::string>{"|0"});
  }
  plant.Run(
      "UPDATE fdi.episode SET label = NULL, detected_ns = detected_ns + d, "
      "ended_ns = ended_ns + d FROM (SELECT 315360000000000000) AS years (d) "
      "WHERE label IS NOT NULL");
  EXPECT_EQ(there(kDetected - kSecond), Pair(0, 2));
  EXPECT_EQ(there(*limits.before_ns), Pair(1, 2)) << "by its arrival";

  plant.Run(
      "INSERT INTO fdi.monitor_session (monitor_id, session_id, start_ns, "
      "alive_ns, software) SELECT monitor_id, 1, 1, 1, '' FROM fdi.monitor");
  const Outcome years_ahead =
      Store("prune --history-age 1s --db '" + Url() + "'");
  EXPECT_EQ(years_ahead.code, 3);
  EXPECT_THAT(years_ahead.err, HasSubstr("--trust-clock"));
}

// Nobody acknowledges a notice.
TEST_F(ShipTest, ANoticeIsPrunedUnacknowledged) {
  Init();
  const auto path = Folder("a") / "history.db";
  {
    HistoryWriter writer(path);
    for (const auto kind :
         {TransitionKind::kDetected, TransitionKind::kClosed}) {
      FaultEvent event = Event(kind, 90, 0, 0.3, EndReason::kCleared);
      event.transition.notice = true;
      writer.Record(event, kDetected);
    }
  }
  ASSERT_EQ(Ship("a").code, 0);
  PlantDatabase plant(Url());
  for (const bool dry_run : {true, false}) {
    const PlantPruned pruned =
        PrunePlantEpisodes(plant, kDetected + 86400 * kSecond, dry_run);
    EXPECT_EQ(pruned.deleted, 1);
    EXPECT_EQ(pruned.kept, 0);
  }
}

// The verbs say of the plant what they say of the history.
TEST_F(ShipTest, TheVerbsReadThePlant) {
  Init();
  const auto path = Folder("a") / "history.db";
  GenerateEpisodes(path, 500, "aaaa");
  {
    HistoryWriter writer(path);
    RecordEpisode(writer, 0b11, "LV-1");
    RecordEpisode(writer, 0b10, "LV-[2]");
    DataGap gap;
    gap.from_ns = kDetected;
    gap.to_ns = kDetected + kSecond;
    gap.reason = "test";
    writer.AddGap(gap);
    EpisodeLook look;
    look.episode_id = Id("LV-1");
    look.period_ns = kSecond;
    constexpr int kFinding = kLastFinding;  // A look may name one, too.
    look.faults = {{1, 0.5, 0.4, 0.6, kDetected, false},
                   {kFinding, 0.5, 0.4, 0.6, kDetected, false}};
    look.x_pct = {1.0};
    look.flow = {2.0};
    writer.StoreLook(look);
    writer.StoreStrength(
        {Id("LV-1"), kDetected, kFinding, 0.5, 0.4, 0.6, Layer::kPhysics});
    for (const int hour : {0, 1, 2}) {
      writer.StoreStrength({Id("LV-1"), kDetected + hour * 3600 * kSecond, 1,
                            0.1 * hour, 0.1 * hour - 0.01, 0.1 * hour + 0.01,
                            Layer::kPhysics});
    }
    std::vector<TracePoint> points;
    for (int k = 0; k < 400; ++k) {
      points.push_back(Instant(k));
    }
    FaultEvent later =
        Event(TransitionKind::kDetected, 10, 0, 0.3, EndReason::kNone, "LV-3");
    later.transition.detection_stamp_ns = later.transition.stamp_ns;
    writer.Record(later, kDetected);
    writer.AppendTrace(later.episode_id, points);
    writer.Commit(kDetected);
    writer.CommitCheckpoint(HoursOfHealth("LV-3"));
    HistoryEditor(path).Label("last", "f7", By("anna", kDetected));
  }
  ASSERT_EQ(Ship("a").code, 0);
  const auto same = [&](const std::string& arguments) {
    const Outcome here = Store(arguments + " --json --data " +
                               (directory_.path() / "a").string());
    const Outcome there =
        Store(arguments + " --json --db '" + Url("postgres") + "'");
    ASSERT_EQ(there.code, here.code) << arguments << ": " << there.err;
    if (here.code != 0) {
      return;
    }
    auto expected = nlohmann::json::parse(here.out);
    auto found = nlohmann::json::parse(there.out);
    const auto without_names = [](nlohmann::json& episode) {
      episode.erase("host");
      episode.erase("monitor");
      episode.erase("as_of_utc");
      episode.erase("since_utc");
      episode.erase("judged_since_utc");
    };
    for (auto* document : {&expected, &found}) {
      without_names(*document);
      // An open episode is in alarm until now.
      for (const char* list : {"days", "valves"}) {
        for (auto& row : (*document)["alarms"][list]) {
          row.erase("alarm_s");
        }
      }
      for (const char* list : {"episodes", "hours", "rows"}) {
        for (auto& row : (*document)[list]) {
          without_names(row);
        }
      }
    }
    EXPECT_TRUE(found == expected)
        << arguments << ": " << nlohmann::json::diff(expected, found);
  };
  for (const char* filter :
       {"", "--rows 7", "--valve V0042", "--valve 'V00[0-4]*'",
        "--valve 'LV-?'", "--valve 'LV-*'", "--fault f7", "--fault unknown",
        "--fault low_flow", "--fault f1 --valve 'V*'", "--state open",
        "--state unacked", "--state rtn_unack", "--state shelved",
        "--state isolated --rows 3", "--from 2026-01-01 --utc"}) {
    same(std::string("history list ") + filter);
  }
  same("history show last");
  same("history show " + EpisodeIdText(Id("LV-1")));
  same("history show aaaa00000000012");
  same("history show aaaa");
  same("history show nothing");
  const auto looks = [](auto reader, std::uint64_t id) {
    return reader.Look(id).value();
  };
  EXPECT_EQ(looks(PlantReader(Url()), Id("LV-1")).x_pct,
            looks(HistoryReader(path), Id("LV-1")).x_pct);
  EXPECT_EQ(PlantReader(Url()).Strengths(Id("LV-1")),
            HistoryReader(path).Strengths(Id("LV-1")));
  EXPECT_EQ(looks(PlantReader(Url()), Id("LV-1")).flow,
            looks(HistoryReader(path), Id("LV-1")).flow);
  same("health --valve LV-3");
  same("health --valve LV-3 --hourly --to 2026-11-20T10:00");
  same("health --valve nothing");
  same("health --valve LV-3 --limit travel=3");
  const std::string since = " --from 2000d --limit travel=3";
  same("worklist --rows 0" + since);
  same("worklist --valve 'LV-*' --discipline instrument" + since);
  const Outcome list =
      Store("history list --rows 1 --csv --db '" + Url() + "' --monitor a");
  EXPECT_THAT(
      list.out,
      HasSubstr("unconfirmed_utc,fault_name,acked_utc,ack_comment,alarm_state,"
                "shelved_until_utc,second,certainty,look_alikes,"
                "about_description,host,monitor\n"));
  EXPECT_THAT(list.out, HasSubstr(",a\n"));
  EXPECT_THAT(Store("history list --db '" + Url() + "' --monitor b").out,
              HasSubstr("no episode matches"));
  EXPECT_THAT(Store("worklist --monitor b --db '" + Url() + "'" + since).out,
              HasSubstr("Nothing was judged: "));
}

// Sets in particular, where globs and regular expressions differ.
TEST_F(ShipTest, APatternMatchesTheSameValvesInBothHistories) {
  Init();
  const auto path = Folder("a") / "history.db";
  {
    HistoryWriter writer(path);
    for (const char* valve : {"a", "b", "d", "5", "]", "[", "\\", ":", "!", "^",
                              "-", "V[1]", "\u00e4"}) {
      writer.Record(
          Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
          kDetected);
    }
  }
  ASSERT_EQ(Ship("a").code, 0);

  HistoryReader here(path);
  PlantReader there(Url());
  for (const char* glob :
       {"?",     "[a-c]",  "[^a]",   "[!a]",    "[]a]",     "[^]a]",    "[[]",
        "[[:]",  "[\\d]",  "[a^]",   "[a-]",    "V[[]?[]]", "[ab",      "[",
        "[c-a]", "[!c-a]", "[c-a^]", "[a-c-e]", "[]-a]",    "[!\u00e4]"}) {
    EpisodeFilter filter;
    filter.valve_glob = glob;
    const auto valves = [&filter](auto& reader) {
      std::set<std::string> found;
      for (const Episode& episode : reader.List(filter)) {
        found.insert(episode.valve_id);
      }
      return found;
    };
    EXPECT_EQ(valves(there), valves(here)) << glob;
  }
}

TEST_F(ShipTest, TheHoursOfAValveAreNotThoseOfAnother) {
  Init();
  Checkpoint checkpoint;
  for (const char* valve : {"V1", "V10", "20.FIC(1"}) {
    checkpoint.coverage.push_back(Coverage(3600));
    checkpoint.coverage.back().valve_id = valve;
  }
  HistoryWriter(Folder("a") / "history.db").CommitCheckpoint(checkpoint);
  ASSERT_EQ(Ship("a").code, 0);

  PlantReader there(Url());
  for (const char* valve : {"V1", "20.FIC(1"}) {
    EpisodeFilter filter;
    filter.valve_glob = valve;
    const auto hours = there.Coverage(filter);
    ASSERT_EQ(hours.size(), 1U) << valve;
    EXPECT_EQ(hours[0].valve_id, valve);
    EXPECT_TRUE(there.Gaps(filter).empty());
  }

  checkpoint.coverage.resize(2);  // Changes of one batch, in Latin-1.
  checkpoint.coverage[0].valve_id = "V\xfc";
  checkpoint.coverage[1].valve_id = "V\xdf";
  HistoryWriter(Folder("a") / "history.db").CommitCheckpoint(checkpoint);
  EXPECT_EQ(Ship("a").code, 0);
}

// The history that it leaves has no row of it that could end.
TEST_F(ShipTest, AnEpisodeThatMovesEndsWhereItWas) {
  Init();
  const auto here = Folder("a") / "history.db";
  const auto there = Folder("b") / "history.db";
  HistoryWriter(here).Record(Event(TransitionKind::kDetected, 0, 0, 0.3),
                             kDetected);
  ASSERT_EQ(Ship("a").code, 0);
  const auto move = [&](const auto& from, const auto& to, int second) {
    Database source(from, HistorySchema(), Access::kOccasionalWriter);
    Database target(to, HistorySchema(), Access::kOccasionalWriter);
    CopyProgress(target, from, "LV-1", kDetected);
    RemoveProgress(source, "LV-1", kDetected + second * kSecond);
  };
  move(here, there, 60);
  ASSERT_EQ(Ship("a").code, 0);
  ASSERT_EQ(Ship("b").code, 0);

  PlantReader reader(Url());
  auto episodes = reader.List({});
  ASSERT_EQ(episodes.size(), 2U);
  EXPECT_EQ(episodes[0].end_reason, "superseded");
  EXPECT_EQ(episodes[0].ended_ns, kDetected + 60 * kSecond);
  EXPECT_EQ(AlarmStateOf(episodes[0]), AlarmState::kNormal);
  EXPECT_EQ(episodes[1].end_reason, std::nullopt);
  std::string id = EpisodeIdText(Id());
  std::ranges::transform(id, id.begin(), [](char c) {
    return static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  });
  EXPECT_EQ(reader.Show(id).id, Id());
  EXPECT_THROW(reader.Show(""), NotFoundError);
  EXPECT_THAT(Store("history list --db '" + Url() + "'").out,
              AllOf(HasSubstr("NORMAL"), HasSubstr("UNACK")));

  move(there, here, -90);  // Its stamps are ahead of the clock.
  ASSERT_EQ(Ship("a").code, 0);
  ASSERT_EQ(Ship("b").code, 0);
  episodes = reader.List({});
  EXPECT_EQ(episodes[0].end_reason, std::nullopt);
  EXPECT_EQ(episodes[1].end_reason, "superseded");
  EXPECT_EQ(episodes[1].ended_ns, kDetected);
}

// Two monitors that take the same valve have an episode and an hour each: there
// is one in the work list, and one alarm. The fuller hour counts.
TEST_F(ShipTest, WhatTwoMonitorsSawCountsOnce) {
  Init();
  for (const char* monitor : {"a", "b"}) {
    HistoryWriter writer(Folder(monitor) / "history.db");
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
    Checkpoint checkpoint = HoursOfHealth("V1");
    checkpoint.health.front().live_ms += *monitor == 'b' ? 1 : 0;
    writer.CommitCheckpoint(checkpoint);
    ASSERT_EQ(Ship(monitor).code, 0);
  }

  PlantReader reader(Url());
  EXPECT_EQ(reader.List({}).size(), 2U);
  EXPECT_EQ(reader.AlarmList(kDetected, 500).size(), 1U);
  const auto hours = reader.Health({"V1"});
  ASSERT_EQ(hours.size(), 2U);
  EXPECT_EQ(hours[0].monitor, "b");
  EXPECT_EQ(hours[1].monitor, "a");
  const auto list = nlohmann::json::parse(
      Store("worklist --json --from 2000d --db '" + Url() + "'").out);
  ASSERT_EQ(list["rows"].size(), 1U);
  EXPECT_EQ(list["rows"][0]["episodes"], 1);
  EXPECT_EQ(list["rows"][0]["monitor"], "a");

  const std::string before = reader.Version();
  EXPECT_EQ(reader.Version(), before);
  ASSERT_EQ(Ship("a").code, 0);
  HistoryWriter(Folder("a") / "history.db")
      .CommitCheckpoint(HoursOfHealth("V1"));
  ASSERT_EQ(Ship("a").code, 0);
  EXPECT_NE(reader.Version(), before);
}

// Two monitors that take the same valves have each episode: the limit counts it
// once. Open episodes come first.
TEST_F(ShipTest, TheAlarmsOfTwoMonitorsAreUpToTheLimit) {
  Init();
  for (const char* monitor : {"a", "b"}) {
    HistoryWriter writer(Folder(monitor) / "history.db");
    for (const char* valve : {"V1", "V2", "V3"}) {
      writer.Record(
          Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
          kDetected);
    }
    for (const char* valve : {"V4", "V5", "V6"}) {
      RecordEpisode(writer, 2, valve);
    }
    ASSERT_EQ(Ship(monitor).code, 0);
  }

  PlantReader reader(Url());
  const auto valves = [&reader](std::int64_t limit) {
    std::vector<std::string> ids;
    for (const Alarm& alarm : reader.AlarmList(kDetected, limit)) {
      ids.push_back(alarm.episode.valve_id);
    }
    return ids;
  };
  using testing::UnorderedElementsAre;
  EXPECT_THAT(valves(2), UnorderedElementsAre("V2", "V3"));
  EXPECT_THAT(valves(4), UnorderedElementsAre("V1", "V2", "V3", "V6"));
  EXPECT_EQ(valves(7).size(), 6U);
}

// Each query of the dashboard, with Grafana's macros written out.
TEST_F(ShipTest, TheDashboardsQueriesRun) {
  Init();
  const auto path = Folder("a") / "history.db";
  GenerateEpisodes(path, 100, "aaaa");
  {
    HistoryWriter writer(path);
    writer.BeginSession(kDetected, "test", "");
    Checkpoint checkpoint;
    checkpoint.coverage.push_back(Coverage(3600));
    writer.CommitCheckpoint(checkpoint);
  }
  ASSERT_EQ(Ship("a").code, 0);
  const auto dashboard = nlohmann::json::parse(Slurp(FDI_DASHBOARD));
  std::vector<std::string> queries;
  for (const auto& panel : dashboard["panels"]) {
    for (const auto& target : panel["targets"]) {
      queries.push_back(target["rawSql"]);
    }
  }
  for (const auto& variable : dashboard["templating"]["list"]) {
    queries.push_back(variable["query"]);
  }
  ASSERT_GT(queries.size(), 9U);
  const std::vector<std::pair<std::regex, std::string>> macros = {
      {std::regex(R"(\$__timeGroupAlias\((\w+), '1h'\))"),
       "floor(extract(epoch from $1) / 3600) * 3600 AS \"time\""},
      {std::regex(R"(\$__timeFilter\((\w+)\))"),
       "$1 BETWEEN '2020-01-01T00:00:00Z' AND '2030-01-01T00:00:00Z'"},
      {std::regex(R"(\$__timeFrom\(\))"), "'2020-01-01T00:00:00Z'"},
      {std::regex(R"(\$__timeTo\(\))"), "'2030-01-01T00:00:00Z'"},
      {std::regex(R"(\$monitor)"), "'a','b'"}};
  for (std::string query : queries) {
    for (const auto& [macro, text] : macros) {
      query = std::regex_replace(query, macro, text);
    }
    EXPECT_EQ(query.find('$'), std::string::npos) << query;
    if (query.find("model_summary") == std::string::npos) {
      EXPECT_FALSE(PlantRowsOf(query).empty()) << query;
    } else {
      PlantRowsOf(query);
    }
  }
}

// Lifts the checks of the schema, as its owner can.
constexpr const char* kLiftChecks =
    "DO $$ DECLARE t text; c text; BEGIN FOR t, c IN SELECT relname, conname "
    "FROM pg_constraint k JOIN pg_class r ON r.oid = conrelid "
    "WHERE conname LIKE '%\\_sound' LOOP "
    "EXECUTE format('ALTER TABLE fdi.%I DROP CONSTRAINT %I', t, c); "
    "END LOOP; END $$";

// Rows that cannot be, each in the place of a good one that an open episode and
// all others of the tables are shown without.
constexpr const char* kBadRows =
    "INSERT INTO fdi.episode_trace SELECT monitor_id, episode_id, 99, 1, "
    "9223372036854775807, 1, 1, 0, 'x', 0, 'x' FROM fdi.episode;"
    "INSERT INTO fdi.episode (monitor_id, episode_id, valve_id, source_id, "
    "detected_ns, isolated_ns, fault_bits, peak_factor, strength, model_set, "
    "model_hash, flow_unit, channels, faults, known, host, monitor) "
    "SELECT 1, 'ffff00000000000' || n, 'V1', 1, d, i, 0, p, 0.5, 'm', 1, u, "
    "'X', 'f1', 'f1', 'h', 'a' FROM (VALUES "
    "(1, 9223372036854775807, -9223372036854775807, 0.5, 'm3/h'),"
    "(2, 1795186571000000000, NULL, 0.5, 'gpm'),"
    "(3, 1795186571000000001, NULL, 'NaN', 'm3/h')) AS v(n, d, i, p, u);"
    "INSERT INTO fdi.coverage_day VALUES "
    "(1, 'V1', 1099511627776, 'LIVE', 9223372036854775807, 1),"
    "(1, 'V1', 106752, 'LIVE', 9223372036854775807, 1);"
    "INSERT INTO fdi.data_gap VALUES "
    "(1, 77, 'V1', 1, 9223372036854775807, 'bad', NULL);"
    "INSERT INTO fdi.shelf VALUES (1, 77, 'V1', NULL, 1, 9223372036854775807, "
    "'anna', NULL, 'test', NULL, NULL, NULL);"
    "INSERT INTO fdi.health_hour VALUES (1, 'V1', 1099511627776, 1, 0, 1, 'x');"
    "INSERT INTO fdi.episode_strength SELECT monitor_id, episode_id, 'f99', 1, "
    "1, 1, 1, 'physics' FROM fdi.episode";

TEST_F(ShipTest, ABadRowHidesNoGoodOne) {
  Init();
  HistoryWriter writer(Folder("a") / "history.db");
  RecordEpisode(writer, 0b01);
  writer.Record(
      Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "V1"),
      kDetected);
  StrengthPoint strength{Id(), kDetected, 7, 0.5, 0.4, 0.6, Layer::kPhysics};
  writer.StoreStrength(strength);
  writer.CommitCheckpoint(HoursOfHealth("V1"));
  writer.AddGap({"V1", kDetected, kDetected + kSecond, "test"});
  writer.Commit(kDetected + kSecond);
  HistoryEditor(Folder("a") / "history.db")
      .Shelve("V1", std::nullopt, kDetected + 3600 * kSecond,
              By("anna", kDetected));
  ASSERT_EQ(Ship("a").code, 0);

  PlantDatabase owner(Url());
  owner.RunScript("CREATE ROLE writer LOGIN IN ROLE fdi_writer");
  const std::string bad = kBadRows;
  for (std::size_t at = 0; at < bad.size();) {
    const std::size_t end = std::min(bad.find(';', at), bad.size());
    const std::string insert = bad.substr(at, end - at);
    if (!insert.starts_with("INSERT INTO fdi.episode_strength")) {
      try {
        PlantDatabase(Url("writer")).Run(insert);
        ADD_FAILURE() << insert;
      } catch (const PlantError& error) {
        EXPECT_THAT(error.what(), HasSubstr("_sound"));
      }
    }
    at = end + 1;
  }

  owner.RunScript(kLiftChecks);
  owner.RunScript(kBadRows);
  PlantReader reader(Url());
  const auto note = [&reader](const char* start) {
    EXPECT_THAT(reader.TakeNote(), testing::StartsWith(start));
    EXPECT_EQ(reader.TakeNote(), "");
  };
  EXPECT_EQ(reader.List({}).size(), 2U);
  note("2 rows could not be read: episode: ");
  EpisodeFilter newest;
  newest.limit = 1;
  ASSERT_EQ(reader.List(newest).size(), 1U) << "the bad ones are newer";
  EXPECT_THAT(reader.TakeNote(), HasSubstr("flow_unit 'gpm' is unknown"));
  EXPECT_EQ(reader.AlarmList(kDetected + kSecond, 10).size(), 2U);
  reader.TakeNote();
  EXPECT_EQ(reader.Coverage({}).size(), 0U);
  note("2 rows could not be read: hours by quality");
  EXPECT_EQ(reader.Gaps({}).size(), 1U);
  note(
      "1 row could not be read: data gap: to_ns '9223372036854775807' is "
      "outside the years 1900 to 2149");
  EXPECT_EQ(reader.Shelves({}).size(), 1U);
  note("1 row could not be read: shelf");
  EXPECT_EQ(reader.Health({"V1"}).size(), 2U);
  EXPECT_EQ(reader.Strengths(Id()).size(), 1U);
  note("1 row could not be read: strength: unknown fault 'f99'");
  EXPECT_NO_THROW(reader.Trace(Id()));
  note("1 row could not be read: evidence");
  owner.RunScript(
      "INSERT INTO fdi.common_cause VALUES (1, 'a', 'air', 1, NULL), "
      "(1, 'b', 'air', 9223372036854775807, NULL);"
      "INSERT INTO fdi.common_cause_member VALUES (1, 'a', '1', 'V1', 'f7', "
      "1), "
      "(1, 'a', '2', 'V2', 'f7', 9223372036854775807), "
      "(1, 'b', '3', 'V3', 'f7', 1)");
  const auto causes = reader.OpenCauses();
  ASSERT_EQ(causes.size(), 1U);
  EXPECT_EQ(causes[0].members.size(), 1U);
  note("2 rows could not be read: common cause: ");
  // Walking the days of such a span would take hours.
  EXPECT_EQ(reader.AlarmFigures({}, kDetected + kSecond).valves.size(), 2U);
  EXPECT_EQ(PlantRowsOf("SELECT count(day_utc) FROM fdi.coverage_hours"),
            std::vector<std::string>{"|0"});
  const Outcome said =
      Store("history list --db '" + Url() + "' --from 2000-01-01 --json");
  EXPECT_THAT(said.err, HasSubstr("plant_rows_left_out"));
}

// A schema that was never released is left as it is.
TEST_F(ShipTest, ASchemaOfBeforeTheBaselineIsRefused) {
  Init();
  PlantDatabase(Url()).RunScript("UPDATE fdi.plant SET version = 10");
  for (const char* command : {"ship --init --db '", "history list --db '"}) {
    const Outcome refused = Store(command + Url() + "'");
    EXPECT_EQ(refused.code, 3);
    EXPECT_THAT(refused.err, HasSubstr("version 10, this program needs"));
    EXPECT_THAT(refused.err, HasSubstr("make another database"));
  }
}

// Somebody has written into this history.db: its other rows go on.
TEST_F(ShipTest, ARowThatThePlantRefusesStopsNothing) {
  Init();
  const auto path = Folder("a") / "history.db";
  HistoryWriter writer(path);
  RecordEpisode(writer, 0b01);
  writer.AddGap({"V1", kDetected, kDetected + kSecond, "good"});
  writer.AddGap(
      {"V1", kDetected, std::numeric_limits<std::int64_t>::max(), "bad"});
  writer.Commit(kDetected + kSecond);
  const Outcome shipped = Ship("a", "--json");
  ASSERT_EQ(shipped.code, 0) << shipped.err;
  EXPECT_EQ(nlohmann::json::parse(shipped.out)["left_out"], 1);
  EXPECT_EQ(PlantRowsOf("SELECT reason FROM fdi.data_gap"),
            std::vector<std::string>{"|good"});
}

// The numbers of rows are given twice.
TEST_F(ShipTest, ARestoredHistoryOverwritesNothing) {
  Init();
  const auto path = Folder("a") / "history.db";
  const auto copy = Folder("a") / "copy.db";
  { HistoryWriter(path).BeginSession(kDetected, "test", ""); }
  Database(path, HistorySchema(), Access::kReader).BackupTo(copy);
  const auto live = [&](std::int64_t from_ns, const std::string& who) {
    HistoryWriter writer(path);
    writer.BeginSession(from_ns, who, "");
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone,
                        "LV-" + who),
                  kDetected);
    writer.AddGap({"V1", kDetected, from_ns, who});
    writer.Commit(from_ns + kSecond);
    HistoryEditor(path).Shelve("V1", std::nullopt, NowNs() + 3600 * kSecond,
                               By(who, NowNs()));
    EXPECT_EQ(Ship("a").code, 0);
  };
  live(kDetected + 100 * kSecond, "first");
  for (const char* rest : {"-wal", "-shm"}) {
    std::filesystem::remove(path.string() + rest);
  }
  std::filesystem::rename(copy, path);
  live(kDetected + 200 * kSecond, "second");

  const auto both = std::vector<std::string>{"|first", "|second"};
  EXPECT_EQ(PlantRowsOf("SELECT reason FROM fdi.data_gap ORDER BY 1"), both);
  EXPECT_EQ(PlantRowsOf("SELECT who FROM fdi.shelf ORDER BY 1"), both);
  EXPECT_EQ(PlantRowsOf("SELECT software FROM fdi.monitor_session "
                        "WHERE software <> 'test' ORDER BY 1"),
            both);
  // A row lost here does not hold there for ever.
  EXPECT_EQ(PlantRowsOf("SELECT who, ended_origin FROM fdi.shelf "
                        "WHERE ended_ns IS NOT NULL"),
            std::vector<std::string>{"|first|history.db was restored"});
  EXPECT_EQ(PlantRowsOf("SELECT valve_id FROM fdi.episode "
                        "WHERE ended_ns IS NULL"),
            std::vector<std::string>{"|LV-second"});
  EXPECT_EQ(PlantRowsOf("SELECT software FROM fdi.monitors"),
            std::vector<std::string>{"|second"});
}

// A lock, a stopped server process, a stopped server, an end of the program.
TEST_F(ShipTest, NoWaitIsWithoutLimit) {
  Init();
  std::stop_source stop;
  PlantLimits limits;
  limits.connect = limits.statement = milliseconds(500);
  limits.lock = milliseconds(100);
  limits.stop = stop.get_token();
  const auto refused = [](const auto& call, const char* reason) {
    const auto start = Clock::now();
    try {
      call();
      ADD_FAILURE() << "waits for " << reason;
    } catch (const PlantError& error) {
      EXPECT_THAT(error.what(), HasSubstr(reason));
    }
    // Without the limits above it is 10 s and more (PlantLimits).
    EXPECT_LT(Clock::now() - start, milliseconds(9000));
  };
  PlantReader reader(Url(), "", limits);
  {
    PlantDatabase other(Url());
    const PlantTransaction transaction(other);
    other.Run("LOCK fdi.episode IN ACCESS EXCLUSIVE MODE");
    refused([&] { reader.List({}); }, "lock timeout");
  }
  EXPECT_NO_THROW(reader.List({})) << "the connection goes on";

  PlantDatabase stopped(Url(), limits);
  const auto server =
      static_cast<pid_t>(stopped.Run("SELECT pg_backend_pid()").Int64(0, 0));
  kill(server, SIGSTOP);
  refused([&] { stopped.Run("SELECT 1"); },
          "timeout expired: waited for an answer for 500 ms");
  refused([&] { stopped.Run("SELECT 1"); }, "PostgreSQL");
  kill(server, SIGKILL);  // The server ends all connections.
  WaitUntil([&] {
    try {
      PlantDatabase again(Url());
      return true;
    } catch (const PlantError&) {
      return false;
    }
  });

  const pid_t postmaster = server_->Pid();
  kill(postmaster, SIGSTOP);
  refused([&] { PlantDatabase(Url(), limits); },
          "timeout expired: waited for a connection for 500 ms");
  limits.connect = std::chrono::seconds(60);
  std::jthread end([&stop] {
    std::this_thread::sleep_for(milliseconds(200));
    stop.request_stop();
  });
  refused([&] { PlantDatabase(Url(), limits); }, "the program stops");
  kill(postmaster, SIGCONT);
}

TEST_F(ShipTest, AWaitIsSaid) {
  Init();
  HistoryWriter writer(Folder("a") / "history.db");
  RecordEpisode(writer, 0b01);
  PlantDatabase other(Url());
  const PlantTransaction transaction(other);
  other.Run("LOCK fdi.episode IN ACCESS EXCLUSIVE MODE");
  const pid_t shipper = Spawn(ShipCommand("a", "20ms"), Log());
  WaitUntil([&] { return Count("plant_waits") == 1; });
  EXPECT_THAT(Slurp(Log()), HasSubstr("waits for an answer for 120 s at most"));
  Stop(shipper);
}

// PgBouncer gives each transaction any of the server's sessions.
TEST_F(ShipTest, APoolerMayGiveEachTransactionAnotherSession) {
  const char* asked = std::getenv("FDI_PGBOUNCER");
  const std::string pooler = asked == nullptr ? "/usr/sbin/pgbouncer" : asked;
  if (!std::filesystem::exists(pooler)) {
    GTEST_SKIP() << "no PgBouncer (Debian: apt install pgbouncer)";
  }
  Init();
  const std::string folder = server_->folder() + "/pool";
  std::filesystem::create_directories(folder);
  std::filesystem::permissions(folder, std::filesystem::perms::all);
  std::ofstream(folder + "/ini")
      << "[databases]\n* = host=" << server_->folder()
      << " user=postgres\n[pgbouncer]\nlisten_addr =\nunix_socket_dir = "
      << folder << "\nauth_type = any\npool_mode = transaction\n"
      << "default_pool_size = 2\npidfile = " << folder
      << "/pid\nlogfile = " << folder << "/log\n";
  const std::string as_user = geteuid() == 0
                                  ? "setpriv --reuid=postgres --regid=postgres "
                                    "--clear-groups "
                                  : "";
  ASSERT_EQ(
      std::system(("cd / && " + as_user + pooler + " -q -d " + folder + "/ini")
                      .c_str()),
      0);
  const std::string pooled =
      "postgresql://postgres@/" + database_ + "?port=6432&host=" + folder;
  const auto path = Folder("a") / "history.db";
  HistoryWriter writer(path);
  for (int i = 0; i < 3; ++i) {
    RecordEpisode(writer, 0b01, "LV-" + std::to_string(i));
    const Outcome outcome = Store("ship --data " + Folder("a").string() +
                                  " --monitor a --db '" + pooled + "'");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    // Two readers hold a connection each, so that the sessions change.
    PlantReader first(pooled);
    PlantReader second(pooled);
    EXPECT_EQ(first.List({}).size(), static_cast<std::size_t>(i + 1));
    EXPECT_EQ(second.List({}).size(), static_cast<std::size_t>(i + 1));
  }
  ExpectEqual("a");
  pid_t pid = 0;
  std::ifstream(folder + "/pid") >> pid;
  ASSERT_GT(pid, 1);
  kill(pid, SIGTERM);
}

}  // namespace
}  // namespace fdi::storage
