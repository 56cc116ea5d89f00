// Runs the built program on a history: list, show, ack, export, doctor, backup.
#include <algorithm>
#include <cmath>
#include <sstream>

#include <gmock/gmock.h>

#include "base/time_text.h"
#include "storage/database/locks.h"
#include "storage/history/health.h"
#include "storage/models/models.h"
#include "storage/runs/run_recorder.h"
#include "tests/programs/store/store_program_fixture.h"
#include "tests/storage/model_set_fixture.h"
#include "tests/storage/small_disk.h"

namespace fdi::storage {
namespace {

using testing::HasSubstr;

class FdiStoreHistoryTest : public FdiStoreTest {
 protected:
  FdiStoreHistoryTest() {
    HistoryWriter writer(path_);
    writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
    writer.AppendTrace(Id(), Instants(100, -20));
    writer.Record(Event(TransitionKind::kIsolated, 20, 0b010, 0.8), kDetected);
    writer.EndSession(kDetected, true);
  }

  // Output of `history list` on a terminal with these variables.
  std::string ListOnTerminal(const std::string& environment) const {
    const std::string out = (directory_.path() / "terminal.txt").string();
    const std::string command =
        environment + " script -qec '\"" + FDI_STORE_PROGRAM + "\" --data " +
        directory_.path().string() + " history list' /dev/null >" + out;
    EXPECT_EQ(std::system(command.c_str()), 0);
    return Slurp(out);
  }
};

TEST_F(FdiStoreHistoryTest, WhatCameOnTopIsInEveryList) {
  {
    FaultEvent event = Event(TransitionKind::kSecond, 90, 0b010, 0.8);
    event.transition.second = {.open = true, .faults = 0b100};
    HistoryWriter(path_).Record(event, kDetected);
  }
  EXPECT_EQ(StoreJson("history list")["episodes"][0]["second"], "f19");
  EXPECT_THAT(Store("history list").out, HasSubstr("f7 and f19: Flashing"));
  EXPECT_THAT(Store("history show last").out, HasSubstr("(f7), and f19\n"));
}

TEST_F(FdiStoreHistoryTest, ListedEpisodesHaveTheColumnsOfTheView) {
  const json listed = StoreJson("history list");

  ASSERT_EQ(listed["episodes"].size(), 1U);
  const json& episode = listed["episodes"][0];
  EXPECT_THAT(
      KeysOf(episode),
      testing::UnorderedElementsAre(
          "episode_id", "valve_id", "about", "detected_utc", "isolated_utc",
          "cleared_utc", "ended_utc", "returned_utc", "fault", "peak_factor",
          "model_set", "end_reason", "label", "acked_by", "strength",
          "worst_strength", "severity", "priority", "unconfirmed_utc",
          "certainty", "look_alikes", "fault_name", "acked_utc", "ack_comment",
          "alarm_state", "shelved_until_utc", "second", "description",
          "witness", "repairs", "return_hours"));
  EXPECT_EQ(episode["fault_name"], "Flashing or critical flow");
  EXPECT_EQ(episode["fault"], "f7");
  EXPECT_EQ(episode["detected_utc"], "2026-11-20T14:56:11.000Z");
  EXPECT_TRUE(episode["cleared_utc"].is_null());
}

TEST_F(FdiStoreHistoryTest, WhoAValveIsStandsInEveryList) {
  const std::string valve =
      StoreJson("history list")["episodes"][0]["valve_id"];
  ASSERT_EQ(Store("valves add " + valve + " --type globe").code, 0);
  ASSERT_EQ(
      Store("valves add " + valve + " --description 'Feed to C-101' --grade 1")
          .code,
      0);
  ASSERT_EQ(Store("valves add " + valve + " --location 'Hall 2'").code, 0);
  EXPECT_EQ(Store("valves add 'FV-*' --location 'Hall 2'").code, 2);
  EXPECT_EQ(StoreJson("valves list")["valves"].size(), 1U);
  // A description leaves the entry of the valve as it was.
  EXPECT_EQ(StoreJson("valves show " + valve)["type"], "globe");
  for (const char* verb : {"history list", "history show last", "worklist"}) {
    EXPECT_THAT(Store(verb).out, HasSubstr("Feed to C-101")) << verb;
  }
  EXPECT_THAT(
      Store("history list --csv").out,
      testing::AllOf(
          HasSubstr(",second,certainty,look_alikes,about_description\n"),
          HasSubstr(",likely,,Feed to C-101\n")));
  const json about = StoreJson("history list")["episodes"][0]["about"];
  EXPECT_EQ(about["grade"], 1);
  EXPECT_EQ(about["location"], "Hall 2");
  EXPECT_EQ(StoreJson("worklist")["rows"][0]["grade_factor"], 2.0);
  EXPECT_EQ(StoreJson("valves list")["loops"][0]["about"], about);

  const Outcome wrong = Store("valves add " + valve + " --costs '-1 EUR/t'");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("an amount is not negative"));
  EXPECT_TRUE(StoreJson("valves list")["loops"][0]["costs"].is_null());
  ASSERT_EQ(Store("valves add " + valve + " --costs '2 EUR/t, 350 EUR'").code,
            0);
  EXPECT_EQ(StoreJson("valves list")["loops"][0]["costs"], "2 EUR/t, 350 EUR");
}

TEST_F(FdiStoreHistoryTest, WhoAValveIsChangesNoEntry) {
  ModelStore(directory_.path() / "models.db", Access::kOccasionalWriter)
      .Save(RandomModelSet("pump"));
  for (const char* verb :
       {"add 'FV-*' --type any --sense opening",
        "add FV-101 --type globe --sense opening", "assign FV-101 pump@1",
        "repaired FV-101 replaced"}) {
    ASSERT_EQ(Store(std::string("valves ") + verb).code, 0) << verb;
  }
  const json entries = StoreJson("valves list")["valves"];
  ASSERT_EQ(entries[1]["model_set"], "pump@1");
  ASSERT_EQ(entries[1]["epoch"], 1);
  EXPECT_EQ(StoreJson("valves add FV-101 --grade 1"), entries[1]);
  EXPECT_EQ(StoreJson("valves add FV-102 --description Feed"), entries[0]);
  EXPECT_EQ(StoreJson("valves list")["valves"], entries);
  json loops = StoreJson("valves list")["loops"];
  ASSERT_EQ(loops.size(), 2U);
  EXPECT_EQ(loops[0]["state"], "onboarded");
  EXPECT_EQ(loops[1]["state"], "expected");
  EXPECT_EQ(loops[1]["about"]["description"], "Feed");

  ASSERT_EQ(Store("valves add FV-102 --description ''").code, 0);
  EXPECT_EQ(StoreJson("valves list")["valves"], entries);
  EXPECT_TRUE(StoreJson("valves list")["loops"][1]["about"].is_null());
  ASSERT_EQ(Store("valves remove FV-102").code, 0);
  ASSERT_EQ(Store("valves remove FV-101").code, 0);
  EXPECT_TRUE(StoreJson("valves list")["loops"].empty());
  EXPECT_NE(Store("valves remove FV-102").code, 0);
}

TEST_F(FdiStoreHistoryTest, WhatTheTableDoesNotStateStays) {
  Write("plant.csv", "name,op,pv,grade\nFIC1,OP,PV,1\nFIC2,OP,PV,\n");
  for (const char* verb :
       {"--plant plant.csv", "FIC1 --grade 3 --location Hall",
        "FIC2 --grade 3 --description Feed", "--plant plant.csv"}) {
    ASSERT_EQ(Store(std::string("valves add ") + verb).code, 0) << verb;
  }
  const json loops = StoreJson("valves list")["loops"];
  EXPECT_EQ(loops[0]["about"]["grade"], 1);
  EXPECT_EQ(loops[0]["about"]["location"], "Hall");
  EXPECT_EQ(loops[1]["about"]["grade"], 3);
  EXPECT_EQ(loops[1]["about"]["description"], "Feed");
  Write("plant.csv", "name,op,pv,costs\nFIC1,OP,PV,3 EUR/kg\n");
  const Outcome refused = Store("valves add --plant plant.csv");
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.out, HasSubstr("none of /t, /m3 and /h"));
}

TEST_F(FdiStoreHistoryTest, WorkOnAValveStandsInItsEpisode) {
  const json before = StoreJson("history list")["episodes"][0];
  EXPECT_TRUE(before["repairs"].empty());
  const std::string valve = before["valve_id"];
  ASSERT_EQ(Store("valves repaired '*' recalibrated --by bo --comment zero "
                  "--at 2026-11-20T15:00:00Z")
                .code,
            0);
  ASSERT_EQ(
      Store("valves repaired " + valve + " repacked --at 2026-11-20T14:00:00Z")
          .code,
      0);
  const json row = StoreJson("history list")["episodes"][0];
  ASSERT_EQ(row["repairs"].size(), 1U);  // The one before is of another.
  EXPECT_EQ(row["repairs"][0]["kind"], "recalibrated");
  EXPECT_THAT(Store("history list").out, HasSubstr(" recalibrated "));
  EXPECT_THAT(Store("--utc history show last").out,
              HasSubstr("recalibrated, 2026-11-20T15:00:00Z by bo: zero"));
  EXPECT_THAT(Store("history show last", "TZ=Asia/Tokyo").out,
              HasSubstr("recalibrated, 2026-11-21T00:00:00"));
  ASSERT_EQ(Store("valves repaired '*' ordered --order 4711").code, 0);
  ASSERT_EQ(
      Store("valves repaired '*' replaced --at 2199-01-01T00:00:00Z").code, 0);
  const std::string list = Store("history list").out;
  EXPECT_THAT(list, HasSubstr(" recalibrated "));
  EXPECT_THAT(list, testing::Not(HasSubstr("ordered")));
  EXPECT_THAT(list, testing::Not(HasSubstr("replaced")));
}

// The end of the data is not the end of the fault.
TEST_F(FdiStoreHistoryTest, WhatEndedWithItsDataStandsInTheList) {
  {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b100, "FV-1");
    writer.Record(
        Event(TransitionKind::kClosed, 60, 0b010, 0.8, EndReason::kStreamEnded),
        kDetected);
  }
  const json listed = StoreJson("history list");
  EXPECT_TRUE(listed["as_of_utc"].is_string());
  for (const json& row : listed["episodes"]) {
    EXPECT_FALSE(row["ended_utc"].is_null());
    EXPECT_EQ(row["returned_utc"].is_null(), row["valve_id"] != "FV-1");
  }
  const std::string text = Store("history list").out;
  EXPECT_THAT(text, testing::ContainsRegex(" -  not confirmed "));
  EXPECT_THAT(text, testing::ContainsRegex(
                        "\nas of 20[-0-9]+T[0-9]+:[0-9]+:[0-9]+[^.]"));
}

// Whatever the ids and names. A file or a pipe gets all columns.
TEST_F(FdiStoreHistoryTest, TheListFitsATerminalOfAHundredColumns) {
  {
    HistoryWriter writer(path_);
    for (const char* valve : {"UNIT-300/AREA-2/FV-10123A", "LV-2"}) {
      RecordEpisode(writer, 0b111, valve);
    }
  }
  std::istringstream list(ListOnTerminal("COLUMNS=100 NO_COLOR=1"));
  std::string all;
  for (std::string line; std::getline(list, line);) {
    std::erase(line, '\r');
    all += line + '\n';
    if (line.find("too narrow") == std::string::npos) {
      EXPECT_LE(std::ranges::count_if(
                    line, [](char c) { return (c & '\xC0') != '\x80'; }),
                100)
          << line;
    }
  }
  for (const char* shown : {"UNIT-300/AREA-2/FV-10123A", "UNACK", "severity",
                            "2026-11-20 ", "Flashing"}) {
    EXPECT_THAT(all, HasSubstr(shown));
  }
  const std::string piped = Store("history list").out;
  for (const char* column :
       {"named after", "label", "acked by", "model set", "demo@3"}) {
    EXPECT_THAT(piped, HasSubstr(column));
  }
  EXPECT_THAT(piped, testing::Not(HasSubstr("too narrow")));
}

// The severity now and the fault come before what only experts read.
TEST_F(FdiStoreHistoryTest, AHundredColumnsSayHowBadItIsInPlainWords) {
  const std::string list = ListOnTerminal("COLUMNS=100 NO_COLOR=1");
  const std::string left_out =
      list.substr(std::min(list.find("(too narrow"), list.size()));

  EXPECT_THAT(list, HasSubstr("Flashing or cr"));
  EXPECT_THAT(list, testing::ContainsRegex("[0-9] %"));
  for (const char* kept : {"severity", "now", "meaning"}) {
    EXPECT_THAT(left_out, testing::Not(HasSubstr(kept)));
  }
}

// The history has no names here, so they are those of the catalogue.
TEST_F(FdiStoreHistoryTest, WhatEndedEarlyIsNotUnlikeAnyKnownFault) {
  {
    HistoryWriter writer(path_);
    FaultEvent event = Event(TransitionKind::kDetected, 60, 0, 0.3);
    event.valve_id = "PV-9";
    event.episode_id = Id("PV-9");
    event.transition.unknown = Unknown::kTooEarly;
    writer.Record(event, kDetected);
    event.transition.kind = TransitionKind::kClosed;
    event.transition.reason = EndReason::kCleared;
    writer.Record(event, kDetected);
  }
  const json row = StoreJson("history list --valve PV-9")["episodes"][0];
  EXPECT_EQ(row["fault"], "unknown");
  EXPECT_EQ(row["fault_name"], "Fault that ended before it had a name");
  EXPECT_EQ(row["certainty"], "not yet");
  EXPECT_THAT(Store("history show last").out,
              HasSubstr("not yet: Fault that ended before it had a name"));
}

TEST_F(FdiStoreHistoryTest, ANameThatWasWithdrawnIsNone) {
  EXPECT_THAT(Store("history list").out, HasSubstr("   20 s"));
  EXPECT_THAT(Store("history show last").out,
              testing::ContainsRegex("named: +[^\n]*, after 20 s\n"));
  HistoryWriter(path_).Record(Event(TransitionKind::kReisolated, 60, 0, 0.3),
                              kDetected);
  EXPECT_THAT(Store("history list").out, testing::Not(HasSubstr("   20 s")));
  const std::string shown = Store("history show last").out;
  EXPECT_THAT(shown, HasSubstr("after 20 s, withdrawn since\n"));
  EXPECT_THAT(shown, HasSubstr("name withdrawn\n"));
  // Its title does not say that it never had one, whatever its end.
  const char* const title = "Fault whose name was withdrawn";
  for (const EndReason end : {EndReason::kNone, EndReason::kCleared}) {
    if (end != EndReason::kNone) {
      HistoryWriter(path_).Record(
          Event(TransitionKind::kClosed, 90, 0, 0.3, end), kDetected);
    }
    EXPECT_EQ(
        StoreJson("history list --valve LV-1")["episodes"][0]["fault_name"],
        title);
    EXPECT_THAT(Store("history list").out, HasSubstr(title));
    EXPECT_THAT(Store("history show last").out, HasSubstr(title));
    EXPECT_THAT(Store("worklist --from 2026-11-01").out, HasSubstr(title));
  }
}

TEST_F(FdiStoreHistoryTest, FiltersReachTheQuery) {
  const auto count = [this](const std::string& arguments) {
    return StoreJson("history list " + arguments)["episodes"].size();
  };

  EXPECT_EQ(count("--fault f7"), 1U);
  EXPECT_EQ(count("--fault paper5"), 0U);
  EXPECT_EQ(count("--valve 'PV*'"), 0U);
  EXPECT_EQ(count("--from 2026-11-20T14:56:12Z"), 0U);
  EXPECT_EQ(count("--to 2026-11-20T14:56:12Z"), 1U);
  EXPECT_EQ(count("--state isolated"), 1U);
  EXPECT_EQ(Store("history list --state odd").code, 2);
  EXPECT_EQ(Store("history list --fault f99").code, 2);
}

TEST_F(FdiStoreHistoryTest, AcknowledgedAndLabelledEpisodeSaysSo) {
  EXPECT_EQ(Store("history ack last --by anna --comment 'seat worn'").code, 0);
  EXPECT_EQ(Store("history label last f1 --by jan").code, 0);

  const json shown = StoreJson("history show last");
  EXPECT_EQ(shown["acked_by"], "anna");
  EXPECT_EQ(shown["ack_comment"], "seat worn");
  EXPECT_EQ(shown["label"], "f1");
  const std::string csv = Store("history list --csv").out;
  EXPECT_THAT(csv, HasSubstr("unconfirmed_utc,fault_name,acked_utc,"
                             "ack_comment,alarm_state,shelved_until_utc,"
                             "second,certainty,"));
  EXPECT_THAT(csv, testing::ContainsRegex("Flashing or critical flow,20[0-9TZ:"
                                          ".-]+,seat worn,ACKED,,,likely,,\n"));
  EXPECT_THAT(Store("history show last").out,
              testing::ContainsRegex("acknowledged: +by anna at 20.+: seat "
                                     "worn\n"));
  EXPECT_EQ(shown["events"].back()["kind"], "LABEL");
  EXPECT_EQ(shown["trace_instants"], 100);
  EXPECT_EQ(Store("history label last perhaps").code, 2);
}

TEST_F(FdiStoreHistoryTest, AGrowingFaultSaysWhenItWillBeFull) {
  {
    HistoryWriter writer(path_);
    for (int day = 0; day < 5; ++day) {
      const double strength = 0.2 + 0.05 * day;
      writer.StoreStrength({Id(), kDetected + day * 86'400 * kSecond, 7,
                            strength, strength - 0.01, strength + 0.01,
                            Layer::kPhysics});
    }
  }
  const json shown = StoreJson("history show last");
  ASSERT_EQ(shown["strengths"].size(), 5U);
  EXPECT_EQ(shown["strengths"][0]["layer"], "physics");
  EXPECT_EQ(shown["strengths"][4]["strength"], 0.4);
  ASSERT_EQ(shown["growth"].size(), 1U);
  const json& growth = shown["growth"][0];
  EXPECT_EQ(growth["fault"], "f7");
  EXPECT_EQ(growth["trend"], "growing");
  EXPECT_NEAR(growth["per_day"].get<double>(), 0.05, 1e-9);
  EXPECT_NEAR(growth["full_in_s"].get<double>(), 12 * 86'400.0, 1e-3);
  EXPECT_LT(growth["full_in_s_lowest"], growth["full_in_s"]);
  EXPECT_GT(growth["full_in_s_highest"], growth["full_in_s"]);
  EXPECT_THAT(
      Store("history show last").out,
      testing::ContainsRegex("f7: strength 0.40 \\(0.39 to 0.41\\), growing "
                             "by 0.05 a day \\(0.04 to 0.06\\); full in 12.0 "
                             "days \\(10.5 to 13.8\\), as of 2026-11-24"));
}

TEST_F(FdiStoreHistoryTest, EveryOneNoticedStandsInTheRecord) {
  EXPECT_EQ(Store("history ack last --by anna --comment 'on it'").code, 0);
  EXPECT_EQ(Store("history ack last --by jan").code, 0);

  const json shown = StoreJson("history show last");
  EXPECT_EQ(shown["acked_by"], "anna");
  EXPECT_EQ(shown["alarm_state"], "ACKED");
  EXPECT_EQ(shown["events"].size(), 4U);
  EXPECT_EQ(shown["events"].back()["who"], "jan");
  EXPECT_THAT(shown["events"].back()["origin"].get<std::string>(),
              testing::MatchesRegex("fdi-store .+@.+"));
}

TEST_F(FdiStoreHistoryTest, AFilterAcknowledgesAllItFindsIfAskedTo) {
  {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b001, "PV-1");
    RecordEpisode(writer, 0b001, "PV-2");
  }
  EXPECT_EQ(Store("history ack").code, 2);
  EXPECT_EQ(Store("history ack last --valve 'PV-*'").code, 2);

  const json first = StoreJson("history ack --valve 'PV-*'");
  const json again = StoreJson("history ack --valve 'PV-*'");

  EXPECT_EQ(first["episodes"].size(), 2U);
  EXPECT_EQ(again["episodes"].size(), 0U);
  EXPECT_EQ(StoreJson("history list --state unack")["episodes"].size(), 1U);
  EXPECT_EQ(StoreJson("history list --state NORMAL")["episodes"].size(), 2U);
  EXPECT_EQ(Store("history ack last ffff").code, 5);
}

TEST_F(FdiStoreHistoryTest, AWindowIsPlannedBeforeAnyMonitorHasRun) {
  const std::int64_t from_ns = NowNs() / kSecond * kSecond + 3600 * kSecond;
  const std::string from = FormatTime(from_ns, true);
  std::filesystem::remove(path_);
  const json planned = StoreJson("--utc history shelve FV-9 --for 2h --from '" +
                                 from + "'")["shelf"][0];
  EXPECT_EQ(ParseTime(planned["from_utc"].get<std::string>(), true), from_ns);
  EXPECT_EQ(ParseTime(planned["until_utc"].get<std::string>(), true),
            from_ns + 7200 * kSecond);
  EXPECT_FALSE(planned["planned_utc"].is_null());
  EXPECT_EQ(StoreJson("history list --shelved")["shelf"].size(), 1U);
  EXPECT_EQ(StoreJson("history shelve FV-9 --off")["shelf"].size(), 1U);
  EXPECT_THAT(Store("--utc history shelve FV-9 --from 2026-01-01").err,
              HasSubstr("planned from a time after now"));
}

// Work that is planned before the first run.
TEST_F(FdiStoreHistoryTest, AShelfNeedsNoFolderYet) {
  const std::string out = (directory_.path() / "shelf").string();
  const auto run = [&](const std::string& verb) {
    const std::string command = "\"" FDI_STORE_PROGRAM "\" --data " + out +
                                "-data/new " + verb + " >" + out + " 2>&1";
    return std::system(command.c_str());
  };
  EXPECT_EQ(run("history shelve FV-9 --for 2h"), 0);
  EXPECT_EQ(run("history list --shelved"), 0);
  EXPECT_THAT(Slurp(out), HasSubstr("FV-9"));
}

TEST_F(FdiStoreHistoryTest, AShelvedAlarmSaysSoUntilItIsTakenOff) {
  const json shelf =
      StoreJson("history shelve LV-1 --for 1h --by anna --comment ordered");
  EXPECT_EQ(shelf["shelf"][0]["valve_id"], "LV-1");
  EXPECT_EQ(StoreJson("history list --state shelved")["episodes"].size(), 1U);
  EXPECT_THAT(Store("history list").out, HasSubstr("SHELVED"));
  EXPECT_EQ(StoreJson("history show last")["shelf"]["who"], "anna");

  EXPECT_EQ(StoreJson("history shelve LV-1 --off")["shelf"].size(), 1U);

  EXPECT_EQ(StoreJson("history list --shelved")["shelf"].size(), 0U);
  EXPECT_EQ(
      StoreJson("history list --shelved --from 1970-01-01")["shelf"].size(),
      1U);
  EXPECT_EQ(Store("history shelve LV-1 --off --for 1h").code, 2);
  EXPECT_THAT(Store("history unshelve 1").err,
              HasSubstr("unshelve is gone: fdi-store history shelve"));
  EXPECT_EQ(Store("history shelve LV-1 --off").code, 5);
  EXPECT_EQ(Store("history shelve LV-1 --for 91d").code, 2);
  EXPECT_THAT(Store("history shelve LV-1 --for 8").err,
              HasSubstr("--for 8: expected a time with its unit"));
  EXPECT_THAT(Store("history shelve LV-11").err,
              HasSubstr("warning valve_unknown valve=LV-11 did_you_mean=LV-1"));
}

// As a pattern, V[1] means V1.
TEST_F(FdiStoreHistoryTest, AnIdThatLooksLikeAPatternIsAnId) {
  {
    HistoryWriter writer(path_);
    for (const char* valve : {"V[1]", "V1", "V2"}) {
      writer.Record(
          Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
          kDetected);
    }
    writer.EndSession(kDetected, true);
  }
  const auto left = [this] {
    std::vector<std::string> valves;
    const json listed = StoreJson("history list");
    for (const json& episode : listed["episodes"]) {
      valves.push_back(episode["valve_id"]);
    }
    return valves;
  };
  EXPECT_EQ(StoreJson("history shelve 'V[1]' --for 1h")["shelf"][0]["valve_id"],
            "V[1]");
  const json shelved = StoreJson("history list --state shelved")["episodes"];
  ASSERT_EQ(shelved.size(), 1U);
  EXPECT_EQ(shelved[0]["valve_id"], "V[1]");

  const auto moved = StoreJson("valves move 'V[1]' there")["valves"];

  ASSERT_EQ(moved.size(), 1U);
  EXPECT_EQ(moved[0]["valve_id"], "V[1]");
  EXPECT_THAT(left(), testing::UnorderedElementsAre("LV-1", "V1", "V2"));
  // No valve of that id is left: a pattern.
  EXPECT_EQ(StoreJson("valves move 'V[1]' there")["valves"].size(), 1U);
  EXPECT_THAT(left(), testing::UnorderedElementsAre("LV-1", "V2"));
}

// A running monitor holds data that is not in the file.
TEST_F(FdiStoreHistoryTest, DoctorSaysWhatIsRecordedElsewhere) {
  EXPECT_EQ(Store("doctor").code, 0);
  {
    const ExclusiveLock lock(directory_.path() / "history.db.lock", "testing");
    const Outcome outcome = Store("doctor");
    EXPECT_EQ(outcome.code, 3);
    EXPECT_THAT(outcome.out, HasSubstr("history.db: process "));
    EXPECT_THAT(outcome.out, HasSubstr("has stored nothing here"));

    HistoryWriter writer(path_);
    writer.BeginSession(NowNs(), "test", "");
    EXPECT_EQ(Store("doctor").code, 0);
  }
  RunRecorder recorder(directory_.path() / "runs.db");
  EXPECT_EQ(Store("doctor").code, 0);
  for (const char* name : {"runs.db", "runs.db-wal", "runs.db-shm"}) {
    std::filesystem::remove(directory_.path() / name);
  }
  EXPECT_THAT(Store("doctor").out, HasSubstr("a recorder runs"));
  EXPECT_TRUE(recorder.Refresh());
  EXPECT_EQ(Store("doctor").code, 0);
}

TEST_F(FdiStoreHistoryTest, AFullDiskCanBeReadAndPruned) {
  const SmallDisk disk(directory_.path() / "disk", "4M");
  if (!disk.mounted()) {
    GTEST_SKIP() << "mounting a file system is not permitted";
  }
  std::filesystem::copy_file(path_, disk.path() / "history.db");
  {
    RunRecorder recorder(disk.path() / "runs.db");
    for (int r = 0; r < 3; ++r) {
      NewRun run;
      run.valve_id = "LV-1";
      run.start_ns = kDetected + r * 100'000 * kSecond;
      const auto key = recorder.Begin(run);
      for (int k = 0; k < 20'000; ++k) {
        Sample sample = Instant(k).sample;
        sample.stamp_ns = run.start_ns + k * kSecond;
        recorder.Append(key, LabelledSample{sample, {}});
      }
      recorder.End(key);
    }
    recorder.Close();
  }
  const auto before = std::filesystem::file_size(disk.path() / "runs.db");
  ASSERT_GT(before, 400'000U);
  disk.Fill();
  data_ = "disk";

  for (const char* call :
       {"history list", "history show last", "runs list", "doctor",
        "history export last -o e.csv", "backup elsewhere"}) {
    const Outcome outcome = Store(call);
    EXPECT_EQ(outcome.code, 0) << call << ": " << outcome.err;
  }
  for (const char* call : {"history ack last --by anna",
                           "history shelve LV-1 --for 8h --by anna"}) {
    const Outcome refused = Store(call);
    EXPECT_EQ(refused.code, 3) << call;
    EXPECT_THAT(refused.err, HasSubstr("the disk is full: 0 bytes are free"));
  }
  const Outcome pruned = Store("prune --runs-size 200kB");
  EXPECT_EQ(pruned.code, 0) << pruned.err;
  EXPECT_LT(std::filesystem::file_size(disk.path() / "runs.db"), before / 2);
  EXPECT_EQ(Store("runs list").code, 0);
  const Outcome acked = Store("history ack last --by anna");
  EXPECT_EQ(acked.code, 0) << acked.err;
  EXPECT_EQ(Store("doctor").code, 0);
}

TEST_F(FdiStoreHistoryTest, SlipsOfThePenAreSuggested) {
  EXPECT_THAT(Store("history lsit").err, HasSubstr("did you mean 'list'"));
  EXPECT_THAT(Store("hsitory list").err, HasSubstr("did you mean 'history'"));
  EXPECT_THAT(Store("history list --valv x").err,
              HasSubstr("did you mean '--valve'"));
  EXPECT_THAT(Store("history list --fault unknwon").err,
              HasSubstr("did you mean 'unknown'"));
  EXPECT_THAT(Store("history list --state isolatd").err,
              HasSubstr("did you mean 'isolated'"));
  EXPECT_THAT(Store("history label last ff7").err,
              HasSubstr("did you mean 'f7'"));
}

TEST_F(FdiStoreHistoryTest, ListIsCsvIfAskedForAndTextWithoutColour) {
  const std::string csv = Store("history list --csv").out;
  EXPECT_THAT(csv, testing::StartsWith("episode_id,valve_id,detected_utc,"));
  EXPECT_EQ(Store("history list --csv --json").code, 2);
  const std::string text = Store("history list").out;
  EXPECT_THAT(text, HasSubstr("UNACK"));
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
  EXPECT_THAT(Store("history list --valve none").out,
              HasSubstr("no episode matches"));
}

TEST_F(FdiStoreHistoryTest, ColourIsForTerminalsThatWantIt) {
  EXPECT_THAT(ListOnTerminal("TERM=xterm NO_COLOR="),
              HasSubstr("\x1b[1;31mUNACK"));
  EXPECT_THAT(ListOnTerminal("TERM=xterm NO_COLOR=1"),
              testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(ListOnTerminal("TERM=dumb"), testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(ListOnTerminal("TERM=xterm COLUMNS=80"), HasSubstr("too narrow"));
}

TEST_F(FdiStoreHistoryTest, WhatTheWorkListTookOverNamesIt) {
  for (const char* verb : {"history stats", "history causes"}) {
    const Outcome outcome = Store(verb);
    EXPECT_EQ(outcome.code, 2) << verb;
    EXPECT_THAT(outcome.err, HasSubstr("is gone: fdi-store worklist"));
  }
}

TEST_F(FdiStoreHistoryTest, TraceIsExportedWithAColumnPerChannelAndFault) {
  const Outcome outcome = Store("history export last");

  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out,
              testing::StartsWith("t_s,stamp_ns,seq,intake,quality,state,"
                                  "CV_pct,X_pct,F_m3_h,r_X,r_F,d_0,d_f1,d_f7,"
                                  "d_f19\n-20,"));
  EXPECT_EQ(std::count(outcome.out.begin(), outcome.out.end(), '\n'), 101);
}

TEST_F(FdiStoreHistoryTest, PlotIsAPictureOrAClearError) {
  const Outcome missing =
      Store("history plot last --output a.png", "PATH=/nowhere");
  EXPECT_EQ(missing.code, 1);
  EXPECT_THAT(missing.err, HasSubstr("gnuplot cannot run"));
  EXPECT_EQ(Store("history plot last --output a.bmp").code, 2);
  if (std::system("gnuplot --version >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "gnuplot is not installed";
  }

  EXPECT_EQ(Store("history plot last --output a.png").code, 0);

  EXPECT_EQ(Slurp(directory_.path() / "a.png").substr(1, 3), "PNG");
  EXPECT_EQ(
      Store("history plot last -o a.svg --from 2026-11-20T14:56:00Z").code, 0);
  EXPECT_THAT(Slurp(directory_.path() / "a.svg"), HasSubstr("isolated f7"));
}

TEST_F(FdiStoreHistoryTest, RemovedPicturesAndPagesNameWhatReplacesThem) {
  const Outcome page = Store("history report last");
  EXPECT_EQ(page.code, 2);
  EXPECT_THAT(page.err, HasSubstr("history show"));
  const Outcome picture = Store("runs plot 1a2b");
  EXPECT_EQ(picture.code, 2);
  EXPECT_THAT(picture.err, HasSubstr("runs export"));
}

TEST_F(FdiStoreHistoryTest, DoctorFindsASoundDirectorySound) {
  const json report = StoreJson("doctor");

  EXPECT_EQ(report["sound"], true);
  ASSERT_EQ(report["databases"].size(), 3U);
  EXPECT_EQ(report["databases"][0]["present"], false);
  EXPECT_EQ(report["databases"][2]["version"], 21);
  EXPECT_EQ(report["databases"][2]["figures"]["open_episodes"], 1);
  EXPECT_EQ(report["databases"][2]["figures"]["unsent_events"], 2);
}

// Four valves with 300 healthy hours each; a fifth has none.
TEST_F(FdiStoreHistoryTest, DoctorTellsWhichBudgetsOfAlarmsAreKept) {
  std::vector<HealthHour> hours;
  for (int v = 0; v < 5; ++v) {
    for (int i = 0; i < (v < 4 ? 300 : 1); ++i) {
      HealthHour& hour = hours.emplace_back();
      hour.valve_id = "TV-" + std::to_string(v);
      hour.hour = 490'300 - i;
      hour.model_hash = 7;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.share = 400 + std::llround(-100.0 * std::log((i + 0.5) / 300.0));
    }
  }
  {
    Database history(path_, HistorySchema(), Access::kWriter);
    Transaction transaction(history);
    StoreHealth(history, hours);
    transaction.Commit();
  }
  const json report = StoreJson("doctor");
  ASSERT_EQ(report["alarm_budgets"].size(), 4U);
  const json& day = report["alarm_budgets"][0];
  EXPECT_EQ(day["budget"], "1/day");
  EXPECT_EQ(day["needed_hours"], 120.0);
  EXPECT_EQ(day["longest_hours"], 12'000.0);
  EXPECT_EQ(day["wait_hours"], 0.0);
  EXPECT_EQ(report["alarm_budgets"][1]["kept"], "yes");
  const json& year = report["alarm_budgets"][3];
  EXPECT_EQ(year["needed_hours"], 43'830.0);
  EXPECT_NEAR(year["wait_hours"].get<double>(), (4383 - 1201) / 5.0, 1.0);
  ASSERT_EQ(report["tails"].size(), 5U);
  EXPECT_EQ(report["tails"][0]["tail"], true);
  EXPECT_EQ(report["tails"][0]["hours"], 300);
  EXPECT_EQ(report["tails"][4]["tail"], false);
  EXPECT_EQ(report["tails"][4]["damaged"], false);

  const std::string text = Store("doctor").out;
  EXPECT_THAT(text, HasSubstr("5 valves are judged, 4 have return periods, "
                              "from 1200 healthy hours"));
  EXPECT_THAT(text, HasSubstr("1/day: needs 120 h, kept: yes"));
  EXPECT_THAT(text, HasSubstr("1/year: needs 43830 h, kept: not yet: about"));
  EXPECT_THAT(text, HasSubstr("TV-4: alarms as its limits are set; "
                              "healthy hours: 1, days: 1"));
}

// Read-only media, or a member of the group after the service was stopped: root
// without the capability that lets it write everywhere.
TEST_F(FdiStoreHistoryTest, AFolderThatCannotBeWrittenIsRead) {
  using std::filesystem::perms;
  Write("x.csv", header_ + Rows(30));
  ASSERT_EQ(Store("runs import x.csv --valve LV-1").code, 0);
  ASSERT_EQ(Store("valves add LV-1 --flow-unit t/h").code, 0);
  const auto data = directory_.path() / "data";
  std::filesystem::create_directory(data);
  for (const char* name : {"history.db", "models.db", "runs.db"}) {
    std::filesystem::rename(directory_.path() / name, data / name);
  }
  std::filesystem::permissions(data, perms::owner_read | perms::owner_exec);
  const std::string as_user =
      geteuid() == 0 ? "setpriv --bounding-set=-dac_override " : "env ";

  std::vector<std::string> verbs{"runs export last", "valves show LV-1",
                                 "history show last", "doctor"};
  if (FDI_PLANNER) {
    verbs.emplace_back("worklist");
  }
  for (const std::string& verb : verbs) {
    const Outcome outcome = Store(verb + " --data data", as_user);
    EXPECT_EQ(outcome.code, 0) << verb << ": " << outcome.err;
  }
  EXPECT_EQ(Store("valves add LV-2 --data data", as_user).code, 3);
  std::filesystem::permissions(data, perms::owner_all);
}

TEST_F(FdiStoreHistoryTest, DoctorExitsWithThreeOnADamagedFile) {
  const auto size = std::filesystem::file_size(path_);
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(4096 * 2);
  for (std::uintmax_t at = 4096 * 2; at < size; ++at) {
    file.put('\x5A');
  }
  file.close();

  const Outcome outcome = Store("doctor --json");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(json::parse(outcome.out)["sound"], false);
}

// Such an id is valid text to SQLite, but the event cannot be sent.
TEST_F(FdiStoreHistoryTest, DoctorFindsADamagedIdInTheOutbox) {
  {
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run(
        "INSERT INTO episode (episode_id, session_id, valve_id, source_id, "
        "detected_ns, peak_factor, strength, model_set, model_hash, flow_unit, "
        "channels, faults) SELECT 'zzzzzzzzzzzzzzzz', session_id, valve_id, "
        "source_id, detected_ns, peak_factor, strength, model_set, model_hash, "
        "flow_unit, channels, faults FROM episode");
    database.Run(
        "INSERT INTO episode_event (event_id, episode_id, kind, stamp_ns, "
        "recorded_ns) VALUES (99, 'zzzzzzzzzzzzzzzz', 'DETECTED', 1, 1)");
    database.Run("INSERT INTO event_outbox (event_id) VALUES (99)");
    transaction.Commit();
  }

  const Outcome outcome = Store("doctor --json");

  EXPECT_EQ(outcome.code, 3);
  EXPECT_EQ(json::parse(outcome.out)["databases"][2]["troubles"],
            json::array({"episode 'zzzzzzzzzzzzzzzz': its id is not 16 hex "
                         "digits",
                         "episode_event 99: its episode id 'zzzzzzzzzzzzzzzz' "
                         "is not 16 hex digits (in event_outbox, not sent)"}));
  EXPECT_THAT(Store("doctor").out, HasSubstr("not 16 hex digits"));
}

// gnuplot does not accept two single quotes at the beginning of a string.
TEST_F(FdiStoreHistoryTest, PictureOfAValveWhoseIdBeginsWithAQuote) {
  if (std::system("gnuplot --version >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "gnuplot is not installed";
  }
  {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b001, "'1\"");
    writer.AppendTrace(Id("'1\""), Instants(50, -10));
    writer.EndSession(kDetected, true);
  }
  const std::string id = EpisodeIdText(Id("'1\""));

  EXPECT_EQ(Store("history plot " + id + " -o a.svg").code, 0);

  EXPECT_THAT(Slurp(directory_.path() / "a.svg"), HasSubstr("'1\":  f1"));
}

TEST_F(FdiStoreHistoryTest, PruneTellsWhatWentAndNeedsALimit) {
  EXPECT_EQ(Store("prune").code, 2);
  EXPECT_EQ(Store("prune --runs-age 90d").code, 5);

  const json dry = StoreJson("prune --history-age 0s --dry-run");
  EXPECT_EQ(dry["dry_run"], true);
  const json done =
      StoreJson("prune --history-age 0s --history-size 1B --trust-clock");
  EXPECT_EQ(done["databases"][0]["name"], "history.db");
  EXPECT_EQ(done["databases"][0]["deleted"], 0);
  EXPECT_EQ(done["databases"][0]["protected"], 1);
  EXPECT_EQ(done["databases"][0]["fits"], false);
}

// The clock stands years ahead, so everything looks old.
TEST_F(FdiStoreHistoryTest, PruneRefusesAClockThatIsFarFromTheNewestRecord) {
  const std::int64_t year_ns = 365 * 86'400 * kSecond;
  {
    HistoryWriter writer(path_);
    writer.BeginSession(NowNs() - year_ns, "test", "");
    writer.EndSession(NowNs() - year_ns, true);
    Database history(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(history);
    history.Run("UPDATE monitor_session SET start_ns = ?1, alive_ns = ?1",
                NowNs() - year_ns);
    history.Run("DROP TRIGGER episode_event_keeps");
    history.Run("UPDATE episode_event SET recorded_ns = ?1", NowNs() - year_ns);
    transaction.Commit();
  }
  const Outcome refused = Store("prune --history-age 30d");
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("nothing is deleted, because the clock"));
  EXPECT_EQ(Store("prune --history-age 30d --dry-run").code, 0);
  EXPECT_EQ(Store("prune --history-age 30d --trust-clock").code, 0);
  {
    HistoryWriter writer(path_);
    writer.BeginSession(NowNs(), "test", "");
    writer.EndSession(NowNs(), true);
  }
  EXPECT_EQ(Store("prune --history-age 30d").code, 0);
}

TEST_F(FdiStoreHistoryTest, BackupIsACompleteCopyAndNeverOverwrites) {
  EXPECT_EQ(Store("backup copy").code, 0);

  EXPECT_EQ(HistoryReader(directory_.path() / "copy/history.db").List().size(),
            1U);
  EXPECT_EQ(Store("backup copy").code, 3);
}

}  // namespace
}  // namespace fdi::storage
