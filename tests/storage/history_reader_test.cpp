#include "storage/history/history_reader.h"

#include <algorithm>
#include <numeric>

#include <gmock/gmock.h>

#include "base/error.h"
#include "base/time_units.h"
#include "storage/history/health.h"
#include "storage/history/healthy_hours.h"
#include "storage/history/valve_move.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using Kind = TransitionKind;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Not;

class HistoryReaderTest : public HistoryFixture {
 protected:
  // LV-1: f7, closed. LV-2: f1|f19, closed. PV-1: never isolated, closed.
  // PV-2: open, detected.
  HistoryReaderTest() : writer_(path_) {
    RecordEpisode(writer_, 0b010, "LV-1");
    RecordEpisode(writer_, 0b101, "LV-2");
    const auto none = EndReason::kNone;
    writer_.Record(Event(Kind::kDetected, 0, 0, 0.3, none, "PV-1"), kDetected);
    writer_.Record(
        Event(Kind::kClosed, 60, 0, 0.3, EndReason::kStaleTimeout, "PV-1"),
        kDetected);
    FaultEvent later = Event(Kind::kDetected, 500, 0, 0.3, none, "PV-2");
    later.transition.detection_stamp_ns += 500 * kSecond;
    writer_.Record(later, kDetected);
  }

  std::vector<std::string> Valves(const EpisodeFilter& filter) {
    std::vector<std::string> valves;
    for (const Episode& episode : HistoryReader(path_).List(filter)) {
      valves.push_back(episode.valve_id);
    }
    return valves;
  }

  // The detection of an episode of NV-1 that is too common to be an alarm.
  FaultEvent RecordNotice() {
    FaultEvent event =
        Event(Kind::kDetected, 0, 0, 0.3, EndReason::kNone, "NV-1");
    event.transition.share = 1.1;
    event.transition.return_hours = 400.0;
    event.transition.notice = true;
    writer_.Record(event, kDetected);
    return event;
  }

  HistoryWriter writer_;
};

TEST_F(HistoryReaderTest, FiltersNarrowTheList) {
  EpisodeFilter valve;
  valve.valve_glob = "LV-*";
  EpisodeFilter fault;
  fault.fault = "F19";
  EpisodeFilter unknown;
  unknown.fault = "unknown";
  EpisodeFilter since;
  since.since_ns = kDetected + 1;
  EpisodeFilter until;
  until.until_ns = kDetected + 1;
  EpisodeFilter before;
  before.until_ns = kDetected;
  EpisodeFilter newest;
  newest.limit = 2;

  EXPECT_THAT(Valves({}), ElementsAre("LV-1", "LV-2", "PV-1", "PV-2"));
  EXPECT_THAT(Valves(valve), ElementsAre("LV-1", "LV-2"));
  EXPECT_THAT(Valves(fault), ElementsAre("LV-2"));
  EXPECT_THAT(Valves(unknown), ElementsAre("PV-1"));
  EXPECT_THAT(Valves(since), ElementsAre("PV-2"));
  EXPECT_THAT(Valves(until), ElementsAre("LV-1", "LV-2", "PV-1"));
  EXPECT_THAT(Valves(before), IsEmpty());
  EXPECT_THAT(Valves(newest), ElementsAre("PV-1", "PV-2"));
}

TEST_F(HistoryReaderTest, StatesNarrowTheList) {
  const auto valves = [this](EpisodeState state) {
    EpisodeFilter filter;
    filter.state = state;
    return Valves(filter);
  };
  HistoryEditor(path_).Acknowledge(EpisodeIdText(Id("LV-2")), By("anna", 1));

  EXPECT_THAT(valves(EpisodeState::kOpen), ElementsAre("PV-2"));
  EXPECT_THAT(valves(EpisodeState::kDetected), ElementsAre("PV-2"));
  EXPECT_THAT(valves(EpisodeState::kIsolated), IsEmpty());
  EXPECT_THAT(valves(EpisodeState::kClosed),
              ElementsAre("LV-1", "LV-2", "PV-1"));
  EXPECT_THAT(valves(EpisodeState::kUnacked),
              ElementsAre("LV-1", "PV-1", "PV-2"));
}

// As every view takes it: nobody is alarmed by a notice until it is raised.
TEST_F(HistoryReaderTest, ANoticeIsListedAndIsNoAlarm) {
  FaultEvent event = RecordNotice();
  const auto state = [this] {
    return Sql("SELECT alarm_state FROM fault_history WHERE valve_id = 'NV-1'");
  };
  const auto alarms = [this] {
    std::vector<std::string> valves;
    for (const Alarm& alarm : HistoryReader(path_).AlarmList(kDetected)) {
      valves.push_back(alarm.episode.valve_id);
    }
    return valves;
  };
  const auto active = [this] {
    const AlarmCounts counts = HistoryReader(path_).CountAlarms(kDetected);
    return std::accumulate(counts.active.begin(), counts.active.end(), 0U);
  };
  EpisodeFilter notices;
  notices.state = EpisodeState::kAlarmNotice;
  const auto unsent = [this] {
    std::int64_t events = 0;
    for (const FaultEvent& each : writer_.UnsentEvents()) {
      events += each.valve_id == "NV-1" ? 1 : 0;
    }
    return events;
  };
  EXPECT_EQ(state(), "NOTICE");
  EXPECT_EQ(unsent(), 0);
  EXPECT_THAT(Valves(notices), ElementsAre("NV-1"));
  EXPECT_THAT(alarms(), Not(Contains("NV-1")));
  EXPECT_EQ(active(), 2U);  // PV-1 and PV-2
  const Episode stored = HistoryReader(path_).Show(EpisodeIdText(Id("NV-1")));
  EXPECT_TRUE(stored.notice);
  EXPECT_EQ(stored.return_hours, 400.0);
  EXPECT_EQ(AlarmStateOf(stored), AlarmState::kNotice);
  EXPECT_EQ(AlarmOf(event).state, AlarmState::kNotice);
  for (const OpenEpisode& open : writer_.OpenEpisodes()) {
    EXPECT_EQ(open.notice, open.valve_id == "NV-1");
    EXPECT_EQ(open.share, open.valve_id == "NV-1" ? 1.1 : 0.0);
  }
  EXPECT_EQ(HistoryReader(path_)
                .AlarmFigures({}, kDetected + 1000 * kSecond)
                .valves.count("NV-1"),
            0U);

  event.transition.kind = Kind::kRaised;
  event.transition.stamp_ns += 30 * kSecond;
  event.transition.share = 2.0;
  event.transition.return_hours = 9000.0;
  event.transition.notice = false;
  writer_.Record(event, kDetected);
  EXPECT_EQ(state(), "UNACK");
  EXPECT_EQ(unsent(), 1);
  EXPECT_THAT(Valves(notices), IsEmpty());
  EXPECT_THAT(alarms(), Contains("NV-1"));
  EXPECT_EQ(active(), 3U);
}

TEST_F(HistoryReaderTest, ANoticeThatMovesWithItsValveStaysOne) {
  RecordNotice();
  const auto there = directory_.path() / "there.db";
  {
    Database target(there, HistorySchema(), Access::kOccasionalWriter);
    CopyProgress(target, path_, "NV-1", kDetected);
  }
  const std::vector<OpenEpisode> open = HistoryWriter(there).OpenEpisodes();
  ASSERT_EQ(open.size(), 1U);
  EXPECT_TRUE(open[0].notice);
  EXPECT_EQ(open[0].share, 1.1);
  EXPECT_EQ(HistoryReader(there).Show("last").return_hours, 400.0);
}

TEST_F(HistoryReaderTest, AnEndThatDoesNotKnowTheReturnPeriodKeepsIt) {
  FaultEvent event = RecordNotice();
  event.transition.kind = Kind::kClosed;
  event.transition.reason = EndReason::kStaleTimeout;
  event.transition.return_hours = std::nullopt;
  writer_.Record(event, kDetected);
  const Episode stored = HistoryReader(path_).Show(EpisodeIdText(Id("NV-1")));
  EXPECT_TRUE(stored.ended_ns);
  EXPECT_EQ(stored.return_hours, 400.0);
}

// One that is open does not make itself common.
TEST_F(HistoryReaderTest, AnEpisodeIsAnHourThatLastsOnceItIsOver) {
  HealthHour hour;
  hour.valve_id = "NV-1";
  hour.hour = kDetected / kNsPerHour - 1;
  hour.model_hash = 1;
  hour.seen_ms = hour.live_ms = 3'600'000;
  hour.share = 700;
  {
    Transaction transaction(writer_.database());
    StoreHealth(writer_.database(), {{hour}});
    transaction.Commit();
  }
  const auto hours = [this] {
    return ReadHealthyHours(writer_.database()).at(0).hours;
  };
  FaultEvent event = RecordNotice();
  event.transition.kind = Kind::kCleared;
  event.transition.stamp_ns += 2 * kNsPerHour + kNsPerMinute;
  writer_.Record(event, kDetected);
  EXPECT_EQ(hours().size(), 1U);

  event.transition.kind = Kind::kClosed;
  event.transition.reason = EndReason::kStaleTimeout;
  writer_.Record(event, kDetected);
  ASSERT_EQ(hours().size(), 2U);
  EXPECT_EQ(hours()[1].hour, kDetected / kNsPerHour);
  EXPECT_EQ(hours()[1].share, 1.0);
  EXPECT_TRUE(hours()[1].at_least);
  EXPECT_EQ(hours()[1].lasted, 2);
}

TEST_F(HistoryReaderTest, EpisodeIsFoundByAUniqueBeginningOfItsId) {
  HistoryReader reader(path_);
  const std::string id = EpisodeIdText(Id("LV-2"));

  EXPECT_EQ(reader.Show(id).fault, "f1|f19");
  EXPECT_EQ(reader.Show(id.substr(0, 8)).valve_id, "LV-2");
  EXPECT_EQ(reader.Show("last").valve_id, "PV-2");
  EXPECT_THROW(reader.Show(""), NotFoundError);
  EXPECT_THROW(reader.Show("*"), NotFoundError);
  EXPECT_THROW(reader.Show("0123456789abcdef"), NotFoundError);
}

TEST_F(HistoryReaderTest, BeginningThatSeveralIdsShareIsRefused) {
  std::string digits;
  for (int valve = 0; valve < 17; ++valve) {  // Two must share a first digit.
    const std::string id = "TV-" + std::to_string(valve);
    writer_.Record(Event(Kind::kDetected, 0, 0, 0.3, EndReason::kNone, id),
                   kDetected);
    digits += EpisodeIdText(Id(id)).front();
  }
  std::sort(digits.begin(), digits.end());
  const auto shared = std::adjacent_find(digits.begin(), digits.end());
  ASSERT_NE(shared, digits.end());

  EXPECT_THROW(HistoryReader(path_).Show(std::string(1, *shared)),
               NotFoundError);
}

TEST_F(HistoryReaderTest, AcknowledgementAndLabelAreInTheViewAndInTheEvents) {
  const std::string id = EpisodeIdText(Id("LV-1"));
  HistoryEditor editor(path_);
  editor.Acknowledge(id, By("anna", kDetected + 1, "valve opened"));
  editor.Label(id, "F7", By("jan", kDetected + 2, "seat worn"));

  EXPECT_EQ(Sql("SELECT acked_by || ' ' || label FROM fault_history "
                "WHERE valve_id = 'LV-1'"),
            "anna f7");
  const auto events = HistoryReader(path_).Events(Id("LV-1"));
  ASSERT_EQ(events.size(), 6U);
  EXPECT_EQ(events[4].kind, "ACK");
  EXPECT_EQ(events[4].comment, "valve opened");
  EXPECT_EQ(events[5].kind, "LABEL");
  EXPECT_EQ(events[5].value, "f7");
  EXPECT_EQ(events[5].who, "jan");
  EXPECT_THAT(writer_.UnsentEvents().size(), 11U);  // None of these two.
}

TEST_F(HistoryReaderTest, UnknownLabelChangesNothing) {
  const std::string id = EpisodeIdText(Id("LV-1"));

  EXPECT_THROW(HistoryEditor(path_).Label(id, "maybe", By("jan", 1)),
               ConfigError);
  EXPECT_THROW(HistoryEditor(path_).Label("ffff", "true", By("jan", 1)),
               NotFoundError);
  EXPECT_EQ(Sql("SELECT count(*) FROM episode WHERE label IS NOT NULL"), "0");
}

TEST_F(HistoryReaderTest, GapsOfAllValvesShowForEachValve) {
  writer_.AddGap({"", kDetected, kDetected + 10, "monitor_down"});
  writer_.AddGap({"PV-1", kDetected + 20, kDetected + 30, "stale"});
  writer_.Commit(kDetected);
  EpisodeFilter filter;
  filter.valve_glob = "LV-1";
  EpisodeFilter later;
  later.since_ns = kDetected + 15;

  ASSERT_EQ(HistoryReader(path_).Gaps(filter).size(), 1U);
  EXPECT_EQ(HistoryReader(path_).Gaps(filter)[0].reason, "monitor_down");
  ASSERT_EQ(HistoryReader(path_).Gaps(later).size(), 1U);
  EXPECT_EQ(HistoryReader(path_).Gaps(later)[0].valve_id, "PV-1");
}

TEST_F(HistoryReaderTest, SessionsTellHowTheyEnded) {
  writer_.BeginSession(kDetected, "0.1.0+abc", "domain = 0");
  writer_.EndSession(kDetected + 5, true);

  const auto sessions = HistoryReader(path_).Sessions();

  ASSERT_EQ(sessions.size(), 1U);
  EXPECT_TRUE(sessions[0].clean);
  EXPECT_EQ(sessions[0].stop_ns, kDetected + 5);
  EXPECT_EQ(sessions[0].config, "domain = 0");
}

TEST_F(HistoryReaderTest, ReadingAHistoryThatIsNotThereIsADataError) {
  EXPECT_THROW(HistoryReader(directory_.path() / "none.db"), DataError);
}

}  // namespace
}  // namespace fdi::storage
