#include "storage/history/history_editor.h"

#include <limits>

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/storage/history_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::storage {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class HistoryEditorTest : public HistoryFixture {
 protected:
  HistoryEditorTest() {
    RecordEpisode(writer_, 0b010, "LV-1");
    RecordEpisode(writer_, 0b101, "LV-2");
    writer_.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "open"),
        kDetected);
  }

  std::vector<HistoryEntry> Notes(const std::string& valve) {
    auto events = HistoryReader(path_).Events(Id(valve));
    std::erase_if(events,
                  [](const HistoryEntry& event) { return event.who.empty(); });
    return events;
  }
  std::string IdText(const std::string& valve) const {
    return EpisodeIdText(Id(valve));
  }
  // Valves of the list, in order.
  std::vector<std::string> Listed(std::int64_t limit = 500) {
    std::vector<std::string> valves;
    for (const Alarm& alarm : HistoryReader(path_).AlarmList(now_, limit)) {
      valves.push_back(alarm.episode.valve_id);
    }
    return valves;
  }
  std::size_t CountOf(EpisodeState state) {
    EpisodeFilter filter;
    filter.state = state;
    filter.now_ns = now_;
    return HistoryReader(path_).List(filter).size();
  }

  const std::int64_t now_ = kDetected + 1000 * kSecond;
  HistoryWriter writer_{path_};
  HistoryEditor editor_{path_};
};

TEST_F(HistoryEditorTest, EveryAcknowledgementAndLabelStaysOnRecord) {
  const OperatorNote anna{"anna", "seen", "console 10.0.0.7", now_};
  const OperatorNote jan{"jan", "", "fdi-store jan@rig", now_};
  editor_.Acknowledge(IdText("LV-1"), anna);
  editor_.Acknowledge(IdText("LV-1"), jan);  // At the same instant.
  editor_.Label(IdText("LV-1"), "true", anna);
  editor_.Label(IdText("LV-1"), "f1", jan);
  editor_.Label(IdText("LV-1"), "f1", jan);

  const auto notes = Notes("LV-1");
  ASSERT_EQ(notes.size(), 5U);
  EXPECT_EQ(notes[0].origin, "console 10.0.0.7");
  EXPECT_EQ(notes[0].comment, "seen");
  EXPECT_EQ(notes[1].who, "jan");
  EXPECT_EQ(notes[1].recorded_ns, now_);
  EXPECT_EQ(notes[4].value, "f1");
  const Episode episode = HistoryReader(path_).Show(IdText("LV-1"));
  EXPECT_EQ(episode.acked_by, "anna");
  EXPECT_EQ(episode.acked_ns, now_);
  EXPECT_EQ(episode.label, "f1");
}

TEST_F(HistoryEditorTest, TextsCannotMoveTheCursorOfATerminal) {
  editor_.Acknowledge(IdText("LV-1"), By("anna", now_, "a\n\x1B[2Jb"));

  EXPECT_EQ(Notes("LV-1").front().comment, "a  [2Jb");
}

TEST_F(HistoryEditorTest, NobodyAndNovelsAreRefused) {
  EXPECT_THAT(MessageOf<ConfigError>(
                  [&] { editor_.Acknowledge("last", By("", now_)); }),
              HasSubstr("who has 0 bytes; accepted are 1 to 128"));
  EXPECT_THROW(
      editor_.Acknowledge("last", By("a", now_, std::string(2001, 'x'))),
      ConfigError);
}

TEST_F(HistoryEditorTest, AnAlarmLeavesTheListEndedAndAcknowledged) {
  EXPECT_THAT(Listed(), ElementsAre("open", "LV-2", "LV-1"));

  editor_.Acknowledge(IdText("LV-1"), By("anna", now_));
  editor_.Acknowledge(IdText("open"), By("anna", now_));

  EXPECT_THAT(Listed(), ElementsAre("open", "LV-2"));
  EXPECT_THAT(Listed(1), ElementsAre("open"));
  const auto alarms = HistoryReader(path_).AlarmList(now_);
  EXPECT_EQ(alarms[0].state, AlarmState::kAcked);
  EXPECT_EQ(alarms[1].state, AlarmState::kReturnedUnacked);
}

// LV-1 and LV-2 were cleared; "open" is active until its data end.
class UnconfirmedTest : public HistoryEditorTest {
 protected:
  void EndData(EndReason reason = EndReason::kStaleTimeout) {
    writer_.Record(Event(TransitionKind::kClosed, 120, 0, 0.3, reason, "open"),
                   now_);
  }
  Alarm Find() {
    HistoryReader reader(path_);
    return reader.Alarms({reader.Show(IdText("open"))}, now_).front();
  }
};

class EndOfDataTest : public UnconfirmedTest,
                      public testing::WithParamInterface<EndReason> {};

TEST_P(EndOfDataTest, IsNoReturnToNormal) {
  EndData(GetParam());
  EXPECT_EQ(Find().state, AlarmState::kUnacked);
  EXPECT_EQ(Find().episode.unconfirmed_ns, kDetected + 120 * kSecond);
  EXPECT_THAT(Listed(), ElementsAre("open", "LV-2", "LV-1"));
  EXPECT_EQ(CountOf(EpisodeState::kAlarmUnacked), 1U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmReturnedUnacked), 2U);

  editor_.Acknowledge(IdText("open"), By("anna", now_ + 1));
  EXPECT_EQ(Find().state, AlarmState::kNormal);
  EXPECT_THAT(Listed(), ElementsAre("LV-2", "LV-1"));
  EXPECT_EQ(CountOf(EpisodeState::kAlarmNormal), 1U);
}

INSTANTIATE_TEST_SUITE_P(Reasons, EndOfDataTest,
                         testing::Values(EndReason::kStreamEnded,
                                         EndReason::kStaleTimeout,
                                         EndReason::kUnknown));

TEST_F(UnconfirmedTest, WhatWasAcknowledgedBeforeStaysToo) {
  editor_.Acknowledge(IdText("open"), By("anna", now_ - 1));
  EndData(EndReason::kStreamEnded);
  EXPECT_EQ(Find().state, AlarmState::kAcked);
  EXPECT_THAT(Listed(), ElementsAre("open", "LV-2", "LV-1"));
  EXPECT_EQ(CountOf(EpisodeState::kAlarmAcked), 1U);

  editor_.Acknowledge(IdText("open"), By("jan", now_ + 1));
  EXPECT_EQ(Find().state, AlarmState::kNormal);
  EXPECT_EQ(Find().episode.acked_by, "anna");
}

TEST_F(UnconfirmedTest, OnlyAValveThatIsJudgedNormalHasReturned) {
  EndData(EndReason::kStaleTimeout);
  writer_.ConfirmNormal("LV-1", kDetected + 500 * kSecond);
  EXPECT_EQ(Find().state, AlarmState::kUnacked);
  writer_.ConfirmNormal("open", kDetected + 500 * kSecond);
  EXPECT_EQ(Find().state, AlarmState::kReturnedUnacked);
  EXPECT_EQ(Find().episode.cleared_ns, kDetected + 500 * kSecond);
  EXPECT_EQ(Find().episode.end_reason, "stale_timeout");
}

TEST_F(UnconfirmedTest, ASilentValveConfirmsNothingUntilItSendsAgain) {
  writer_.StoreSilence("open", kDetected + 90 * kSecond);
  writer_.StoreSilence("LV-1", kDetected + 90 * kSecond);
  EXPECT_EQ(Find().episode.unconfirmed_ns, kDetected + 90 * kSecond);
  EXPECT_EQ(Find().state, AlarmState::kUnacked);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmReturnedUnacked), 2U) << "LV-1 is over";
  // Neither an acknowledgement nor a normal verdict ends what is open.
  editor_.Acknowledge(IdText("open"), By("anna", now_ + 1));
  writer_.ConfirmNormal("open", kDetected + 500 * kSecond);
  EXPECT_EQ(Find().state, AlarmState::kAcked);
  EXPECT_EQ(Find().episode.unconfirmed_ns, kDetected + 90 * kSecond);
  EXPECT_FALSE(Find().episode.cleared_ns);

  writer_.StoreSilence("open", std::nullopt);
  EXPECT_FALSE(Find().episode.unconfirmed_ns);
  EXPECT_EQ(Find().state, AlarmState::kAcked);
}

TEST_F(UnconfirmedTest, TheNextEpisodeOfTheValveTakesItsPlace) {
  EndData(EndReason::kStaleTimeout);
  FaultEvent next =
      Event(TransitionKind::kDetected, 500, 0, 0.3, EndReason::kNone, "open");
  next.episode_id = 99;
  writer_.Record(next, now_);
  EXPECT_EQ(Find().state, AlarmState::kNormal);
  EXPECT_EQ(Listed().size(), 3U) << "LV-1, LV-2 and the next one";
  EXPECT_EQ(CountOf(EpisodeState::kAlarmNormal), 1U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmUnacked), 1U);
}

TEST_F(HistoryEditorTest, StatesOfTheStandardCanBeAskedFor) {
  editor_.Acknowledge(IdText("LV-1"), By("anna", now_));
  editor_.Shelve("LV-2", std::nullopt, now_ + kSecond, By("anna", now_));

  EXPECT_EQ(CountOf(EpisodeState::kAlarmUnacked), 1U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmAcked), 0U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmReturnedUnacked), 1U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmNormal), 1U);
  EXPECT_EQ(CountOf(EpisodeState::kAlarmShelved), 1U);
  EXPECT_EQ(CountOf(ParseEpisodeState("RTN_UNACK")), 1U);
  // The clock is set back: what is shelved stays it.
  EpisodeFilter filter;
  filter.state = EpisodeState::kAlarmShelved;
  filter.now_ns = now_ - 3600 * kSecond;
  EXPECT_EQ(HistoryReader(path_).List(filter).size(), 1U);
}

TEST_F(HistoryEditorTest, AShelfOutlivesTheProgramAndEndsByItself) {
  const std::int64_t until = now_ + 3600 * kSecond;
  const Shelf shelf =
      editor_.Shelve("LV-1", "F7", until, By("anna", now_, "seat ordered"));

  HistoryReader reader(path_);
  const auto in_force = reader.Shelves(until - 1);
  ASSERT_EQ(in_force.size(), 1U);
  EXPECT_EQ(in_force[0].shelf_id, shelf.shelf_id);
  EXPECT_EQ(in_force[0].fault, "f7");
  EXPECT_EQ(in_force[0].comment, "seat ordered");
  EXPECT_TRUE(reader.Shelves(until).empty());
  EXPECT_EQ(reader.Shelves().size(), 1U);
  // The clock is set back by an hour.
  EXPECT_EQ(reader.Shelves(now_ - 3600 * kSecond).size(), 1U);
  const auto alarms = reader.Alarms(reader.List(), now_);
  EXPECT_TRUE(alarms[0].shelf);
  EXPECT_FALSE(alarms[1].shelf);
}

TEST_F(HistoryEditorTest, ShelvingAgainReplacesAndEndingIsRecordedOnce) {
  const auto first =
      editor_.Shelve("LV-1", "f19|f1", now_ + 100, By("anna", now_));
  const auto second =
      editor_.Shelve("LV-1", "f1|f19", now_ + 900, By("jan", now_ + 10));
  EXPECT_EQ(HistoryReader(path_).Shelves(now_ + 20).size(), 1U);

  const auto ended = editor_.EndShelf(second.shelf_id, By("eva", now_ + 30));

  EXPECT_EQ(ended.ended_ns, now_ + 30);
  EXPECT_EQ(ended.ended_by, "eva");
  EXPECT_EQ(ended.ended_origin, "test");
  EXPECT_TRUE(HistoryReader(path_).Shelves(now_ + 30).empty());
  EXPECT_THROW(editor_.EndShelf(second.shelf_id, By("eva", now_ + 40)),
               DataError);
  EXPECT_THROW(editor_.EndShelf(99, By("eva", now_)), NotFoundError);
  EXPECT_EQ(HistoryReader(path_).Shelves()[0].ended_by, "jan");
  EXPECT_EQ(first.fault, "f1|f19");
}

TEST_F(HistoryEditorTest, ShelvingHasItsLimits) {
  EXPECT_THROW(editor_.Shelve("LV-1", "f99", now_ + 1, By("a", now_)),
               ConfigError);
  EXPECT_THROW(editor_.Shelve("", std::nullopt, now_ + 1, By("a", now_)),
               ConfigError);
  EXPECT_THROW(editor_.Shelve("LV-1", std::nullopt, now_, By("a", now_)),
               ConfigError);
  EXPECT_THROW(editor_.Shelve("LV-1", std::nullopt, now_ + kMaxShelfNs + 1,
                              By("a", now_)),
               ConfigError);
  EXPECT_EQ(HistoryReader(path_).Shelves().size(), 0U);
}

TEST_F(HistoryEditorTest, APlannedShelfBeginsAtItsTime) {
  const std::int64_t from = now_ + 3600 * kSecond;
  const std::int64_t until = from + 3600 * kSecond;
  const auto plan = [&](std::int64_t begin, std::int64_t end) {
    return editor_.Shelve("LV-1", std::nullopt, end, By("anna", now_), begin);
  };
  const Shelf planned = plan(from, until);
  editor_.Shelve("LV-1", std::nullopt, now_ + kSecond, By("jan", now_));

  HistoryReader reader(path_);
  const auto shelf_at = [&](std::int64_t ns) {
    EpisodeFilter filter;
    filter.now_ns = ns;
    filter.state = EpisodeState::kAlarmShelved;
    const bool found = !reader.List(filter).empty();
    const auto alarm = reader.Alarms(reader.List(), ns).front();
    EXPECT_EQ(found, alarm.shelf.has_value()) << ns - now_;
    return alarm.shelf ? alarm.shelf->who : "";
  };
  EXPECT_EQ(shelf_at(now_), "jan") << "what is in force stays";
  EXPECT_EQ(shelf_at(from - 1), "");
  EXPECT_EQ(shelf_at(from), "anna");
  EXPECT_EQ(shelf_at(until), "");
  EXPECT_EQ(reader.Shelves(from - 1).size(), 1U) << "planned is not over";

  // Another plan for the same time takes its place; one for later does not.
  plan(from - kSecond, until);
  plan(until, until + kSecond);
  EXPECT_EQ(reader.Shelves(from).size(), 2U);
  EXPECT_EQ(reader.Shelves()[0].ended_by, "anna");
  EXPECT_THROW(editor_.EndShelf(planned.shelf_id, By("eva", now_)), DataError);
  const auto last = reader.Shelves().back().shelf_id;
  EXPECT_EQ(editor_.EndShelf(last, By("eva", now_)).ended_by, "eva");

  EXPECT_THROW(plan(now_, until), ConfigError);
  EXPECT_THROW(plan(from, from), ConfigError);
  EXPECT_THROW(plan(now_ + kMaxShelfNs + 1, now_ + kMaxShelfNs + 2),
               ConfigError);
}

TEST_F(HistoryEditorTest, TheShelfIsAppendOnly) {
  editor_.Shelve("LV-1", std::nullopt, now_ + kSecond, By("anna", now_));
  Database file(path_, HistorySchema(), Access::kOccasionalWriter);
  Transaction transaction(file);

  EXPECT_THROW(file.Run("DELETE FROM shelf"), SqliteError);
  EXPECT_THROW(file.Run("UPDATE shelf SET who = 'nobody'"), SqliteError);
}

TEST_F(HistoryEditorTest, FiguresComeFromTheFilterAndTheFile) {
  editor_.Label(IdText("LV-1"), "false", By("anna", now_));
  EpisodeFilter filter;
  filter.valve_glob = "LV-*";

  const auto figures = HistoryReader(path_).AlarmFigures(filter, now_);

  EXPECT_EQ(figures.valves.size(), 2U);
  EXPECT_NEAR(figures.valves.at("LV-1").alarm_s, 91.0, 1e-6);
  EXPECT_EQ(figures.labelled_false, 1);
  filter.fault = "f19";
  EXPECT_EQ(HistoryReader(path_).AlarmFigures(filter, now_).valves.size(), 1U);
  filter.since_ns = kDetected + 92 * kSecond;
  EXPECT_TRUE(HistoryReader(path_).AlarmFigures(filter, now_).valves.empty());
}

}  // namespace
}  // namespace fdi::storage
