#include "storage/history/history_writer.h"

#include <gmock/gmock.h>

#include "base/error.h"
#include "base/text.h"
#include "storage/history/certainty.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using Kind = TransitionKind;
using testing::ElementsAre;

constexpr const char* kView =
    "SELECT concat_ws FROM (SELECT detected_utc || ' ' || isolated_utc || ' ' "
    "|| cleared_utc || ' ' || fault || ' ' || peak_factor || ' ' || model_set "
    "|| ' ' || end_reason AS concat_ws FROM fault_history)";

using HistoryWriterTest = HistoryFixture;

TEST_F(HistoryWriterTest, ViewTellsTheLifeOfAnEpisode) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b101);

  EXPECT_EQ(Sql(kView),
            "2026-11-20T14:56:11.000Z 2026-11-20T14:56:31.000Z "
            "2026-11-20T14:57:41.000Z f1|f19 0.8 demo@3 cleared");
  EXPECT_EQ(Sql("SELECT episode_id FROM fault_history"), EpisodeIdText(Id()));
  EXPECT_EQ(Sql("SELECT label IS NULL AND acked_by IS NULL FROM "
                "fault_history"),
            "1");
}

TEST_F(HistoryWriterTest, ViewHasTheColumnsOfTheContractInOrder) {
  HistoryWriter writer(path_);
  Database database(path_, HistorySchema(), Access::kReader);
  const Statement row = database.Prepare("SELECT * FROM fault_history");

  std::vector<std::string> columns;
  for (int c = 0; c < row.ColumnCount(); ++c) {
    columns.push_back(row.ColumnName(c));
  }

  EXPECT_THAT(
      columns,
      ElementsAre("episode_id", "valve_id", "detected_utc", "isolated_utc",
                  "cleared_utc", "fault", "peak_factor", "model_set",
                  "end_reason", "label", "acked_by", "strength",
                  "worst_strength", "severity", "priority", "unconfirmed_utc",
                  "fault_name", "acked_utc", "ack_comment", "alarm_state",
                  "shelved_until_utc", "ended_utc", "certainty", "look_alikes",
                  "second", "description", "return_hours"));
}

TEST_F(HistoryWriterTest, ViewSaysHowCertainANameIsAndWhenItEnded) {
  const std::string certain =
      "SELECT certainty || ' ' || ifnull(look_alikes, '-') || ' ' ||"
      " ifnull(second, '-') || ' ' || ifnull(ended_utc, '-')"
      " FROM fault_history";
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  EXPECT_EQ(Sql(certain), "not yet - - -");
  FaultEvent outside = Event(Kind::kReisolated, 10, 0, 0.3);
  outside.transition.unknown = Unknown::kOutsideKnown;
  writer.Record(outside, kDetected);
  EXPECT_EQ(Sql(certain), "not known - - -");
  writer.Record(Event(Kind::kIsolated, 20, 0b101, 0.8), kDetected);
  EXPECT_EQ(Sql(certain), "one of - - -");
  writer.Record(Event(Kind::kReisolated, 30, 0b100, 0.8), kDetected);
  const Episode episode = HistoryReader(path_).Show("last");
  EXPECT_EQ(Sql("SELECT certainty FROM fault_history"),
            CertaintyName(CertaintyOf(episode)));
  EXPECT_EQ(Sql("SELECT ifnull(look_alikes, '') FROM fault_history"),
            JoinText(LookAlikesOf(episode), "|"));
  writer.Record(Event(Kind::kClosed, 40, 0b100, 0.1, EndReason::kCleared),
                kDetected);
  EXPECT_EQ(Sql("SELECT ended_utc FROM fault_history"),
            "2026-11-20T14:56:51.000Z");
}

TEST_F(HistoryWriterTest, ViewHasTheNamesOfTheMonitorThatStartedLast) {
  HistoryWriter writer(path_);
  writer.BeginSession(kDetected, "test", "",
                      {{"f1", "Blocked"}, {"f19", "Flow wrong"}, {"f9", "x"}});
  RecordEpisode(writer, 0b101);
  EXPECT_EQ(Sql("SELECT fault || ': ' || fault_name FROM fault_history"),
            "f1|f19: Blocked or Flow wrong");

  EXPECT_EQ(Sql("SELECT description FROM fault_history"),
            "valve clogging or flow sensor fault");

  writer.BeginSession(kDetected, "test", "", {{"f1", "Travel blocked"}});
  EXPECT_EQ(Sql("SELECT fault_name FROM fault_history"),
            "Travel blocked or Flow wrong");
  EXPECT_EQ(HistoryReader(path_).Show("last").fault_name,
            "Travel blocked or Flow wrong");
}

// A file that was replaced and took no session, as on a full disk, has none to
// end: the session that the copy holds died.
TEST_F(HistoryWriterTest, WithoutASessionNobodysIsEnded) {
  HistoryWriter writer(path_);
  writer.BeginSession(kDetected, "test", "");
  const std::filesystem::path copy = path_.string() + ".copy";
  writer.database().BackupTo(copy);
  std::filesystem::rename(copy, path_);
  ASSERT_TRUE(writer.Refresh());

  writer.EndSession(kDetected + 60 * kSecond, true);

  EXPECT_EQ(Sql("SELECT count(*) FROM monitor_session WHERE stop_ns IS NULL"),
            "1");
  EXPECT_EQ(writer.BeginSession(kDetected + 90 * kSecond, "test", "").died_ns,
            kDetected);
}

TEST_F(HistoryWriterTest, WhatTheSetKnowsIsKeptWithItsSigns) {
  auto models = std::make_shared<ModelSet>(*Event(Kind::kDetected, 0).models);
  models->faults = {2, 5, 19};
  models->observers.push_back({"f19 -0.50", 19, -0.5, {}});
  HistoryWriter writer(path_);
  for (const Kind kind : {Kind::kDetected, Kind::kIsolated}) {
    FaultEvent event = Event(kind, 0, 0b001, 1.0);
    event.models = models;
    writer.Record(event, kDetected);
  }
  const auto shown = [&] { return HistoryReader(path_).Show("last"); };
  EXPECT_THAT(shown().known, ElementsAre("f2", "f5", "f19-"));
  EXPECT_THAT(LookAlikesOf(shown()), ElementsAre("f19"));
  EXPECT_EQ(CertaintyOf(shown()), Certainty::kOneOf);
}

TEST_F(HistoryWriterTest, WhatEndedBeforeItHadANameIsNotUnlikeAnyFault) {
  HistoryWriter writer(path_);
  writer.BeginSession(kDetected, "test", "", {{"unknown", "Unlike any"}});
  const auto name_of = [&](const char* valve, Unknown why, EndReason reason) {
    FaultEvent event = Event(Kind::kDetected, 0);
    event.valve_id = valve;
    event.episode_id += static_cast<std::uint64_t>(valve[0]);
    event.transition.unknown = why;
    writer.Record(event, kDetected);
    event.transition.kind = Kind::kClosed;
    event.transition.reason = reason;
    writer.Record(event, kDetected);
    const Episode last =
        HistoryReader(path_).Show(EpisodeIdText(event.episode_id));
    if (why == Unknown::kTooEarly) {
      EXPECT_EQ(last.fault_name, NoNameText(last));
    } else {
      EXPECT_EQ(NoNameText(last), "");
    }
    return last.fault_name.value_or("");
  };
  EXPECT_EQ(name_of("A", Unknown::kTooEarly, EndReason::kCleared),
            "Fault that ended before it had a name");
  EXPECT_EQ(name_of("B", Unknown::kTooEarly, EndReason::kStaleTimeout),
            "Fault without a name yet");
  EXPECT_EQ(name_of("C", Unknown::kOutsideKnown, EndReason::kCleared),
            "Unlike any");
}

TEST_F(HistoryWriterTest, ViewHasTheCommentOfTheAcknowledgementThatCounts) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b001);
  EXPECT_EQ(Sql("SELECT acked_utc IS NULL AND ack_comment IS NULL FROM "
                "fault_history"),
            "1");
  HistoryEditor editor(path_);
  editor.Acknowledge("last",
                     {"anna", "on my way", "test", kDetected + kSecond});
  editor.Acknowledge("last", {"jan", "me too", "test", kDetected + kSecond});
  EXPECT_EQ(Sql("SELECT acked_by || ' ' || acked_utc || ' ' || ack_comment "
                "FROM fault_history"),
            "anna 2026-11-20T14:56:12.000Z on my way");
  EXPECT_EQ(HistoryReader(path_).Show("last").ack_comment, "on my way");
}

TEST_F(HistoryWriterTest, FaultIsNullUntilIsolatedAndUnknownIfItNeverWas) {
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  EXPECT_EQ(Sql("SELECT fault FROM fault_history"), "NULL");
  EXPECT_EQ(Sql("SELECT isolated_utc FROM fault_history"), "NULL");

  writer.Record(Event(Kind::kClosed, 50, 0, 0.3, EndReason::kStreamEnded),
                kDetected);

  EXPECT_EQ(Sql("SELECT fault FROM fault_history"), "unknown");
  EXPECT_EQ(Sql("SELECT end_reason FROM fault_history"), "stream_ended");
  EXPECT_EQ(Sql("SELECT cleared_utc FROM fault_history"), "NULL");
}

// An alarm whose data ended stands until the valve is normal or has another.
TEST_F(HistoryWriterTest, ANoticeTakesThePlaceOfNoAlarmUntilItIsRaised) {
  HistoryWriter writer(path_);
  const auto standing = [this] {
    return Sql("SELECT count(*) FROM episode WHERE unconfirmed_ns IS NOT NULL");
  };
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  writer.Record(Event(Kind::kClosed, 50, 0, 0.3, EndReason::kStreamEnded),
                kDetected);
  EXPECT_EQ(standing(), "1");
  FaultEvent event = Event(Kind::kDetected, 0, 0, 0.3);
  ++event.episode_id;
  event.transition.notice = true;
  writer.Record(event, kDetected);
  EXPECT_EQ(standing(), "1");
  event.transition.kind = Kind::kRaised;
  event.transition.notice = false;
  writer.Record(event, kDetected);
  EXPECT_EQ(standing(), "0");
}

TEST_F(HistoryWriterTest, ReisolationReplacesTheAnswerAndKeepsTheFirstTime) {
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  writer.Record(Event(Kind::kIsolated, 20, 0b001, 0.9), kDetected);
  writer.Record(Event(Kind::kReisolated, 60, 0b110, 0.75), kDetected);

  EXPECT_EQ(Sql("SELECT fault FROM fault_history"), "f7|f19");
  EXPECT_EQ(Sql("SELECT isolated_utc FROM fault_history"),
            "2026-11-20T14:56:31.000Z");
  EXPECT_EQ(Sql("SELECT peak_factor FROM fault_history"), "0.75");
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_fault"), "3");

  writer.Record(Event(Kind::kReisolated, 90, 0, 0.3), kDetected);
  EXPECT_EQ(Sql("SELECT fault_name FROM fault_history"),
            "Fault whose name was withdrawn");
}

TEST_F(HistoryWriterTest, RecordingTwiceIsANoOp) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b010);
  const std::string before = Sql(kView);

  EXPECT_FALSE(writer.Record(Event(Kind::kDetected, 0, 0, 0.9), kDetected));
  EXPECT_FALSE(
      writer.Record(Event(Kind::kIsolated, 20, 0b100, 0.9), kDetected));
  RecordEpisode(writer, 0b100);

  EXPECT_EQ(Sql(kView), before);
  EXPECT_EQ(Sql("SELECT count(*) FROM episode"), "1");
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_event"), "4");
  EXPECT_EQ(Sql("SELECT group_concat(fault) FROM episode_fault"), "f7");
}

TEST_F(HistoryWriterTest, EventsCannotBeChangedOrTakenOut) {
  {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b010);
  }
  Database database(path_, HistorySchema(), Access::kOccasionalWriter);
  const Transaction transaction(database);

  EXPECT_THROW(database.Run("UPDATE episode_event SET factor = 1"),
               SqliteError);
  EXPECT_THROW(database.Run("DELETE FROM episode_event"), SqliteError);
  EXPECT_NO_THROW(database.Run("DELETE FROM episode"));
  EXPECT_EQ(database.QueryInt64("SELECT count(*) FROM episode_event"), 0);
}

TEST_F(HistoryWriterTest, TransitionIsOnTheDiskWhenTheWriterDies) {
  {
    HistoryWriter writer(path_);
    writer.BeginSession(kDetected, "0.1.0+abc", "domain = 0");
    writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
    writer.AppendTrace(Id(), Instants(1800, -1800));
    writer.Record(Event(Kind::kIsolated, 20, 0b010, 0.8), kDetected);
    writer.AppendTrace(Id(), Instants(5, 0));  // Never committed.
  }
  HistoryWriter writer(path_);

  EXPECT_TRUE(writer.database().Check().empty());
  const auto open = writer.OpenEpisodes();
  ASSERT_EQ(open.size(), 1U);
  EXPECT_EQ(open[0].episode_id, Id());
  ASSERT_EQ(open[0].candidates.size(), 1U);
  EXPECT_EQ(open[0].candidates[0].fault, 7);
  EXPECT_EQ(open[0].detection_stamp_ns, kDetected);
  // Its isolation is later than what there is of its trace.
  EXPECT_EQ(open[0].last_stamp_ns, kDetected + 20 * kSecond);
  EXPECT_EQ(HistoryReader(path_).Show("last").trace_end_ns,
            kDetected - kSecond);
}

TEST_F(HistoryWriterTest, SessionThatDidNotEndIsFoundAtItsLastSignOfLife) {
  {
    HistoryWriter writer(path_);
    EXPECT_EQ(writer.BeginSession(kDetected, "v", "").died_ns, std::nullopt);
    writer.Commit(kDetected + 11 * kSecond);
    writer.Commit(kDetected + 12 * kSecond);  // Too soon for another sign.
  }
  HistoryWriter writer(path_);

  const SessionStart start =
      writer.BeginSession(kDetected + 100 * kSecond, "v", "");
  writer.EndSession(kDetected + 200 * kSecond, true);

  EXPECT_EQ(start.died_ns, kDetected + 11 * kSecond);
  EXPECT_EQ(start.session_id, 2);
  EXPECT_EQ(Sql("SELECT group_concat(clean) FROM monitor_session"), "0,1");
}

// A gap from a sign of life in the future would end before it begins.
TEST_F(HistoryWriterTest, AClockThatIsSetBackHasSignsOfLife) {
  const std::int64_t earlier = kDetected - 3600 * kSecond;
  {
    HistoryWriter writer(path_);
    writer.BeginSession(kDetected, "v", "");
    writer.Commit(earlier);
    writer.Commit(earlier + 30 * kSecond);
    EXPECT_EQ(Sql("SELECT max(alive_ns) FROM monitor_session WHERE stop_ns IS "
                  "NULL"),
              std::to_string(earlier + 30 * kSecond));
  }
  HistoryWriter writer(path_);
  EXPECT_EQ(writer.BeginSession(earlier - kSecond, "v", "").died_ns,
            earlier - kSecond);
}

TEST_F(HistoryWriterTest, NoSessionEndsBeforeItBegins) {
  HistoryWriter writer(path_);
  writer.BeginSession(kDetected, "v", "c");
  writer.Commit(kDetected + 20 * kSecond);
  writer.Commit(kDetected - 3600 * kSecond);
  RecordEpisode(writer, 0b010);
  writer.EndSession(kDetected - 7200 * kSecond, true);

  EXPECT_EQ(
      Sql("SELECT group_concat(((start_ns - " + std::to_string(kDetected) +
          ") / 1000000000) || '+' || ((stop_ns - start_ns) / 1000000000) "
          "|| ' ' || clean || software || config) FROM monitor_session"),
      "0+20 1vc,-3600+0 1vc,-7200+0 1vc");
  EXPECT_EQ(Sql("SELECT session_id FROM episode"), "2");
}

TEST_F(HistoryWriterTest, EpisodeOfADeadMonitorCanBeClosedOnce) {
  { HistoryWriter(path_).Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected); }
  HistoryWriter writer(path_);

  EXPECT_TRUE(writer.Record(End(Id(), kDetected + 60 * kSecond), kDetected));
  EXPECT_FALSE(writer.Record(End(Id(), kDetected + 61 * kSecond), kDetected));

  EXPECT_EQ(Sql("SELECT fault || end_reason FROM fault_history"),
            "unknownunknown");
  EXPECT_TRUE(writer.OpenEpisodes().empty());
  EXPECT_THROW(writer.Record(End(42, 0), kDetected), NotFoundError);
}

TEST_F(HistoryWriterTest, ResumedEpisodeGoesOnUnderItsOldId) {
  { HistoryWriter(path_).Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected); }
  HistoryWriter writer(path_);
  writer.Resume(Id(), kDetected + 60 * kSecond, kDetected);
  FaultEvent isolated = Event(Kind::kIsolated, 80, 0b100, 0.9);
  isolated.source_id = 99;  // The publisher was restarted too.
  isolated.transition.detection_stamp_ns = kDetected + 60 * kSecond;
  isolated.episode_id = Id();

  EXPECT_TRUE(writer.Record(isolated, kDetected));

  EXPECT_EQ(Sql("SELECT count(*) FROM episode"), "1");
  EXPECT_EQ(Sql("SELECT fault FROM fault_history"), "f19");
  EXPECT_EQ(
      Sql("SELECT group_concat(kind) FROM (SELECT kind FROM episode_event "
          "ORDER BY event_id)"),
      "DETECTED,RESUMED,ISOLATED");
}

TEST_F(HistoryWriterTest, EventsNotMarkedAsSentAreFoundAtTheNextStart) {
  const std::vector<FaultCandidate> candidates{
      {19, 0.1 + 0.2, -1.0 / 3.0, true}, {1, 0.8, 0.5, true}, {8, 5e-324, 0.0}};
  {
    HistoryWriter writer(path_);
    const FaultEvent detected = Event(Kind::kDetected, 0, 0, 0.3);
    writer.Record(detected, kDetected);
    FaultEvent isolated = Event(Kind::kIsolated, 20, 0b101, 0.8);
    isolated.seq = 77;
    isolated.candidates = candidates;
    writer.Record(isolated, kDetected);
    writer.MarkSent(detected);
    writer.Commit(kDetected);
  }
  HistoryWriter writer(path_);

  const auto unsent = writer.UnsentEvents();

  ASSERT_EQ(unsent.size(), 1U);
  EXPECT_EQ(unsent[0].episode_id, Id());
  EXPECT_EQ(unsent[0].valve_id, "LV-1");
  EXPECT_EQ(unsent[0].source_id, kSource);
  EXPECT_EQ(unsent[0].transition.kind, Kind::kIsolated);
  EXPECT_EQ(unsent[0].transition.stamp_ns, kDetected + 20 * kSecond);
  EXPECT_EQ(unsent[0].transition.detection_stamp_ns, kDetected);
  EXPECT_EQ(unsent[0].transition.faults, 0b101U);
  EXPECT_EQ(unsent[0].transition.factor, 0.8);
  EXPECT_EQ(unsent[0].transition.reason, EndReason::kNone);
  EXPECT_EQ(unsent[0].seq, 77U);
  ASSERT_EQ(unsent[0].candidates.size(), candidates.size());
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    EXPECT_EQ(unsent[0].candidates[i].fault, candidates[i].fault);
    EXPECT_EQ(unsent[0].candidates[i].factor, candidates[i].factor);
    EXPECT_EQ(unsent[0].candidates[i].strength, candidates[i].strength);
    EXPECT_EQ(unsent[0].candidates[i].isolated, candidates[i].isolated);
  }
  EXPECT_EQ(unsent[0].model_set, "demo");
  EXPECT_EQ(unsent[0].model_version, 3);
  EXPECT_TRUE(unsent[0].persisted);
  EXPECT_EQ(unsent[0].model_hash, models_.content_hash);
}

TEST_F(HistoryWriterTest, IsolationWithoutItsDetectionStillMakesTheEpisode) {
  HistoryWriter writer(path_);

  EXPECT_TRUE(writer.Record(Event(Kind::kIsolated, 20, 0b010, 0.8), kDetected));

  EXPECT_EQ(Sql("SELECT detected_utc || ' ' || fault FROM fault_history"),
            "2026-11-20T14:56:11.000Z f7");
}

TEST_F(HistoryWriterTest, WhatIsRecordedTogetherIsThereAsAWholeOrNotAtAll) {
  HistoryWriter writer(path_);
  writer.BeginSession(kDetected, "test", "");
  const auto record_both = [&] {
    writer.Record(Event(TransitionKind::kDetected, 0), kDetected);
    writer.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.0, EndReason::kNone, "LV-2"),
        kDetected);
  };

  EXPECT_THROW(writer.CommitBatch([&] {
    record_both();
    throw std::runtime_error("the disk");
  }),
               std::runtime_error);
  EXPECT_EQ(Sql("SELECT count(*) FROM episode"), "0");
  writer.CommitBatch(record_both);
  writer.CommitBatch(record_both);

  EXPECT_EQ(Sql("SELECT count(*) FROM episode"), "2");
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_event"), "2");
  EXPECT_EQ(writer.UnsentEvents().size(), 2U);
}

TEST_F(HistoryWriterTest, AnEpisodeThatIsNotThereSpoilsNothingBesideIt) {
  HistoryWriter writer(path_);
  writer.CommitBatch([&] {
    writer.Record(Event(TransitionKind::kDetected, 0), kDetected);
    EXPECT_THROW(writer.Resume(1, kDetected, kDetected), NotFoundError);
    EXPECT_THROW(writer.Record(End(1, kDetected), kDetected), NotFoundError);
  });

  EXPECT_EQ(Sql("SELECT count(*) FROM episode"), "1");
}

// A flow error that grows from 2.5 % on.
class GrowingAlarmTest : public HistoryWriterTest {
 protected:
  FaultEvent At(Kind kind, double after_s, double strength, Severity severity) {
    FaultEvent event =
        Event(kind, after_s, kind == Kind::kDetected ? 0 : 0b100, 0.8);
    event.transition.strength = strength;
    event.transition.lowest = strength - 0.01;
    event.transition.highest = strength + 0.01;
    event.transition.severity = severity;
    return event;
  }
  GrowingAlarmTest() {
    writer_.Record(At(Kind::kDetected, 0, 0.0, Severity::kMedium), kDetected);
    writer_.Record(At(Kind::kIsolated, 20, 0.025, Severity::kMedium),
                   kDetected + 20 * kSecond);
    editor_.Acknowledge("last", By("anna", kDetected + 30 * kSecond));
  }
  StrengthPoint Point(int after_s, double strength, Severity severity) const {
    return {Id(),
            kDetected + after_s * kSecond,
            19,
            strength,
            strength - 0.01,
            strength + 0.01,
            Layer::kObservers,
            severity};
  }
  Episode Shown() { return HistoryReader(path_).Show("last"); }

  HistoryWriter writer_{path_};
  HistoryEditor editor_{path_};
};

TEST_F(GrowingAlarmTest, ItsStrengthIsThatOfNowAndItsWorstIsKept) {
  writer_.StoreStrength(Point(500, 0.2, Severity::kMedium));
  EXPECT_EQ(Shown().strength, 0.2);
  EXPECT_EQ(Shown().lowest, 0.19);
  writer_.StoreStrength(Point(900, 0.1, Severity::kMedium));
  EXPECT_EQ(Shown().strength, 0.1);
  EXPECT_EQ(Shown().worst_strength, 0.2);
  EXPECT_EQ(Shown().acked_by, "anna");
  StrengthPoint other = Point(901, 0.9, Severity::kLow);
  // Not of the fault that the name has its strength of.
  other.severity.reset();
  writer_.StoreStrength(other);
  EXPECT_EQ(Shown().strength, 0.1);
  EXPECT_EQ(Sql("SELECT strength || ' ' || worst_strength || ' ' || severity ||"
                " ' ' || priority FROM fault_history"),
            "0.1 0.2 medium 3");
}

TEST_F(GrowingAlarmTest, ASecondFaultHasToBeAcknowledgedAndItsEndHasNot) {
  ASSERT_EQ(Shown().acked_by, "anna");
  FaultEvent event = At(Kind::kSecond, 7000, 0.2, Severity::kMedium);
  event.transition.second.open = true;
  event.transition.second.faults = event.transition.faults;
  EXPECT_TRUE(writer_.Record(event, kDetected + 7200 * kSecond));
  EXPECT_EQ(Shown().acked_by, std::nullopt);
  EXPECT_EQ(Shown().fault, "f19");
  const auto latest = [this] {
    const auto events = HistoryReader(path_).Events(Id());
    return events.back().kind + " " + events.back().value;
  };
  EXPECT_EQ(latest(), "SECOND f19");
  EXPECT_EQ(Shown().second, "f19");
  const auto left = [this] { return writer_.OpenEpisodes().at(0).second; };
  EXPECT_TRUE(left().open);
  EXPECT_EQ(left().faults, event.transition.faults);
  event.transition.stamp_ns += kSecond;
  event.transition.second.faults = 0;
  EXPECT_TRUE(writer_.Record(event, kDetected + 7201 * kSecond));
  EXPECT_EQ(latest(), "SECOND unknown");
  EXPECT_EQ(Shown().second, "unknown");
  EXPECT_TRUE(left().open);
  EXPECT_EQ(left().faults, 0U);
  EXPECT_EQ(writer_.UnsentEvents().back().transition.kind, Kind::kSecond);
  EXPECT_EQ(OnTheBus(Kind::kSecond), Kind::kReisolated);
  editor_.Acknowledge("last", By("anna", kDetected + 7201 * kSecond));
  event.transition.stamp_ns += kSecond;
  event.transition.second.open = false;
  EXPECT_TRUE(writer_.Record(event, kDetected + 7202 * kSecond));
  EXPECT_EQ(latest(), "SECOND none");
  EXPECT_EQ(Shown().second, std::nullopt);
  EXPECT_FALSE(left().open);
  EXPECT_EQ(Shown().acked_by, "anna");
}

TEST_F(GrowingAlarmTest, AHigherPriorityHasToBeAcknowledgedAgain) {
  const std::int64_t rose = kDetected + 7200 * kSecond;
  EXPECT_TRUE(
      writer_.Record(At(Kind::kChanged, 7000, 0.9, Severity::kCritical), rose));
  EXPECT_EQ(Shown().acked_by, std::nullopt);
  EXPECT_EQ(Shown().acked_ns, std::nullopt);
  EXPECT_EQ(Shown().priority, 1);
  EXPECT_EQ(Shown().strength, 0.9);
  EXPECT_EQ(Shown().fault, "f19");
  const auto events = HistoryReader(path_).Events(Id());
  EXPECT_EQ(events.back().kind, "CHANGED");
  EXPECT_EQ(events.back().priority, 1);
  EXPECT_EQ(writer_.UnsentEvents().back().transition.severity,
            Severity::kCritical);
  EXPECT_EQ(writer_.OpenEpisodes().at(0).severity, Severity::kCritical);

  const auto critical = [&] {
    const AlarmCounts counts = HistoryReader(path_).CountAlarms(rose);
    const auto i = static_cast<std::size_t>(Severity::kCritical);
    return std::pair(counts.active[i], counts.unacked[i]);
  };
  EXPECT_EQ(critical(), std::pair(1UL, 1UL));
  editor_.Acknowledge(EpisodeIdText(Id()), By("jan", rose));
  EXPECT_EQ(Shown().acked_by, "jan");
  EXPECT_EQ(critical(), std::pair(1UL, 0UL));
  editor_.Shelve("LV-1", std::nullopt, rose + kSecond, By("jan", rose - 1));
  EXPECT_EQ(critical(), std::pair(0UL, 0UL));
}

TEST_F(GrowingAlarmTest, AnotherNameHasToBeAcknowledgedAgainIfItIsWorse) {
  writer_.Record(At(Kind::kReisolated, 40, 0.1, Severity::kMedium), kDetected);
  EXPECT_EQ(Shown().acked_by, "anna");
  writer_.Record(At(Kind::kReisolated, 50, 0.1, Severity::kLow), kDetected);
  EXPECT_EQ(Shown().acked_by, "anna");
  writer_.Record(At(Kind::kReisolated, 60, 0.1, Severity::kHigh), kDetected);
  EXPECT_EQ(Shown().acked_by, std::nullopt);
}

// The evidence of an episode ends ten minutes after its isolation.
TEST_F(GrowingAlarmTest, WhatIsLeftOpenWasKnownUpToTheLastSample) {
  EXPECT_EQ(writer_.OpenEpisodes().at(0).last_stamp_ns,
            kDetected + 20 * kSecond);
  const std::int64_t last = kDetected + 72 * 3600 * kSecond;
  Checkpoint checkpoint;
  checkpoint.accumulators.push_back(
      {"LV-1", kSource, models_.content_hash, last, {}});
  writer_.CommitCheckpoint(checkpoint);
  EXPECT_EQ(writer_.OpenEpisodes().at(0).last_stamp_ns, last);
}

// The first version after the baseline.
TEST_F(HistoryWriterTest, EpisodesOfTheBaselineKnowTheFaultsOfTheirTrace) {
  Schema baseline = HistorySchema();
  baseline.migrations.resize(1);
  {
    Database database(path_, baseline, Access::kWriter);
    Transaction transaction(database);
    database.Run(
        "INSERT INTO episode (episode_id, valve_id, source_id, detected_ns, "
        "peak_factor, strength, model_set, model_hash, flow_unit, channels, "
        "faults) VALUES ('00000000000000aa', 'V', 1, 2, 1.0, 1.0, 'm@1', 1, "
        "'m3/h', 'X', 'f2|f19')");
    transaction.Commit();
  }
  EXPECT_THROW(HistoryReader reader(path_), OutdatedError);
  const HistoryWriter migrates(path_);
  EXPECT_THAT(HistoryReader(path_).Show("last").known,
              ElementsAre("f2", "f19"));
  EXPECT_TRUE(std::filesystem::exists(
      path_.string() + ".v" + std::to_string(baseline.version()) + ".backup"));
}

TEST_F(HistoryWriterTest, SameGapTwiceIsOneGap) {
  HistoryWriter writer(path_);
  const DataGap all{"", kDetected, kDetected + kSecond, "monitor_down"};
  const DataGap one{"LV-1", kDetected, kDetected + kSecond, "monitor_down"};
  writer.AddGap(all);
  writer.AddGap(all);
  writer.AddGap(one);
  writer.Commit(kDetected);
  writer.AddGap(all);
  EXPECT_TRUE(writer.HasPending());
  writer.Commit(kDetected);

  EXPECT_FALSE(writer.HasPending());
  EXPECT_EQ(Sql("SELECT count(*) FROM data_gap"), "2");
}

TEST_F(HistoryWriterTest, FailedCommitKeepsWhatIsPending) {
  HistoryWriter writer(path_);
  writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
  writer.AppendTrace(Id(), Instants(700, 0));
  // 700 instants need three chunks; a full disk is a limit on pages.
  const auto pages =
      writer.database().QueryInt64("PRAGMA page_count").value_or(0);
  writer.database().QueryInt64("PRAGMA max_page_count = " +
                               std::to_string(pages));
  EXPECT_THROW(writer.Commit(kDetected), SqliteError);
  EXPECT_TRUE(writer.HasPending());
  writer.database().QueryInt64("PRAGMA max_page_count = 1000000");

  writer.Commit(kDetected);

  EXPECT_EQ(HistoryReader(path_).Trace(Id()).size(), 700U);
}

TEST_F(HistoryWriterTest, TimeAddsUpByDayAndQuality) {
  HistoryWriter writer(path_);
  CoverageDay day{"LV-1", 20'000, 2.0, {}};
  day.samples.Add(Quality::kLive, 1800);
  day.samples.Add(Quality::kUncovered, 900);
  CoverageDay next = day;
  next.day = 20'001;
  Checkpoint checkpoint;
  checkpoint.coverage = {day, next};
  writer.CommitCheckpoint(checkpoint);
  checkpoint.coverage = {day};
  writer.CommitCheckpoint(checkpoint);

  HistoryReader reader(path_);
  auto times = reader.Coverage();
  ASSERT_EQ(times.size(), 2U);
  EXPECT_EQ(times[0].quality, "LIVE");
  EXPECT_EQ(times[0].samples, 5400);
  EXPECT_DOUBLE_EQ(times[0].hours, 3.0);
  EpisodeFilter filter;
  filter.since_ns = 20'001 * 86'400 * kSecond;
  times = reader.Coverage(filter);
  ASSERT_EQ(times.size(), 2U);
  EXPECT_DOUBLE_EQ(times[1].hours, 0.5);
  filter.valve_glob = "X*";
  EXPECT_TRUE(reader.Coverage(filter).empty());
  EpisodeFilter before;  // The day that begins where the filter ends.
  before.until_ns = 20'001 * 86'400 * kSecond;
  times = reader.Coverage(before);
  ASSERT_EQ(times.size(), 2U);
  EXPECT_DOUBLE_EQ(times[0].hours, 2.0);
  EXPECT_EQ(Sql("SELECT day_utc FROM coverage_hours LIMIT 1"), "2024-10-04");
}

TEST_F(HistoryWriterTest, TheNewestAccumulatorOfAValveIsKept) {
  HistoryWriter writer(path_);
  const std::vector<std::byte> bytes{std::byte{1}, std::byte{0}};
  Checkpoint checkpoint;
  checkpoint.accumulators = {{"A", 1, 2, 3, {}}, {"B", 4, 5, 6, bytes}};
  writer.CommitCheckpoint(checkpoint);
  const std::uint64_t large = 0xFFFF'FFFF'FFFF'FFFFULL;
  checkpoint.accumulators = {{"A", large, 7, 8, bytes}};
  writer.CommitCheckpoint(checkpoint);
  const auto kept = HistoryWriter(path_).Accumulators();
  ASSERT_EQ(kept.size(), 2U);
  EXPECT_EQ(kept[0].source_id, large);
  EXPECT_EQ(kept[0].stamp_ns, 8);
  EXPECT_EQ(kept[0].bytes, bytes);
  EXPECT_EQ(kept[1].model_hash, 5U);
}

TEST_F(HistoryWriterTest, UnknownSaysWhyUntilAFaultIsIsolated) {
  HistoryWriter writer(path_);
  HistoryReader reader(path_);
  FaultEvent detected = Event(Kind::kDetected, 0);
  detected.transition.unknown = Unknown::kTooEarly;
  writer.Record(detected, kDetected);
  EXPECT_EQ(reader.Show("last").unknown_kind, "too_early");
  FaultEvent cleared = Event(Kind::kCleared, 50);
  cleared.transition.unknown = Unknown::kOutsideKnown;
  writer.Record(cleared, kDetected);
  EXPECT_EQ(reader.Show("last").unknown_kind, "outside_known");
  writer.Record(Event(Kind::kIsolated, 60, 1, 0.9), kDetected);
  EXPECT_EQ(reader.Show("last").unknown_kind, std::nullopt);
}

TEST_F(HistoryWriterTest, TheNameOfADriftSaysItsSizeAndPace) {
  HistoryWriter writer(path_);
  FaultEvent named = Event(Kind::kIsolated, 60, 1, 0.9);
  named.transition.drift = {0.2, 0.04, 5.0};
  writer.Record(named, kDetected);
  HistoryReader reader(path_);
  EXPECT_EQ(reader.Events(reader.Show("last").id).back().value,
            "X reads 0.2 % above its model, growing by 0.04 % an hour for "
            "5.0 h");
}

TEST_F(HistoryWriterTest, TheLayerThatNamedTheFaultIsKept) {
  HistoryWriter writer(path_);
  HistoryReader reader(path_);
  writer.Record(Event(Kind::kDetected, 0), kDetected);
  EXPECT_EQ(reader.Show("last").layer, std::nullopt);
  writer.Record(Event(Kind::kIsolated, 10, 0b001, 0.9), kDetected);
  EXPECT_EQ(reader.Show("last").layer, "observers");
  FaultEvent corrected = Event(Kind::kReisolated, 50, 0b100, 0.2);
  corrected.transition.layer = Layer::kPhysics;
  writer.Record(corrected, kDetected);
  EXPECT_EQ(reader.Show("last").layer, "physics");
  EXPECT_EQ(writer.OpenEpisodes().at(0).layer, Layer::kPhysics);
  writer.Record(Event(Kind::kClosed, 60, 0b100, 0.2, EndReason::kStreamEnded),
                kDetected);
  EXPECT_EQ(reader.Show("last").layer, "physics");

  std::vector<std::string> layers;
  for (const HistoryEntry& entry : reader.Events(Id())) {
    layers.push_back(entry.layer);
  }
  EXPECT_EQ(layers, (std::vector<std::string>{"", "observers", "physics", ""}));
}

// Written behind the back of SQLite's keys, as a disk or a person would.
class DamagedIdTest : public HistoryFixture {
 protected:
  DamagedIdTest() {
    {
      HistoryWriter writer(path_);
      writer.Record(Event(Kind::kDetected, 0, 0, 0.3), kDetected);
      writer.Record(Event(Kind::kDetected, 0, 0, 0.3, EndReason::kNone, "LV-2"),
                    kDetected);
    }
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run("DROP TRIGGER episode_event_keeps");
    database.QueryInt64("PRAGMA defer_foreign_keys = ON");
    for (const char* table : {"episode", "episode_event"}) {
      database.Run(std::string("UPDATE ") + table +
                       " SET episode_id = 'zz not hex digit' "
                       "WHERE episode_id = ?",
                   EpisodeIdText(Id()));
    }
    transaction.Commit();
  }
};

TEST_F(DamagedIdTest, TheOthersAreReadAndTheRowIsNamed) {
  HistoryWriter writer(path_);
  std::vector<std::string> damaged;

  const auto unsent = writer.UnsentEvents(&damaged);

  ASSERT_EQ(unsent.size(), 1U);
  EXPECT_EQ(unsent[0].valve_id, "LV-2");
  EXPECT_THAT(damaged, ElementsAre("event_outbox, event 1: episode id 'zz not "
                                   "hex digit' is damaged: it is not 16 hex "
                                   "digits"));
  EXPECT_EQ(writer.OpenEpisodes(&damaged).size(), 1U);
  EXPECT_EQ(damaged.size(), 2U);
  EXPECT_THROW(writer.UnsentEvents(), DataError);
}

TEST_F(DamagedIdTest, TheCheckOfTheFileFindsIt) {
  HistoryReader reader(path_);

  EXPECT_THAT(
      reader.database().Check(),
      ElementsAre("episode 'zz not hex digit': its id is not 16 hex digits",
                  "episode_event 1: its episode id 'zz not hex digit' is not "
                  "16 hex digits (in event_outbox, not sent)"));
}

}  // namespace
}  // namespace fdi::storage
