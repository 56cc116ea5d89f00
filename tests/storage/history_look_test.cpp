#include <algorithm>
#include <utility>

#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/certainty.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

class HistoryLookTest : public HistoryFixture {
 protected:
  EpisodeLook Look(double misfit) const {
    EpisodeLook look;
    look.episode_id = Id();
    look.first_ns = kDetected - 2 * kSecond;
    look.period_ns = kSecond;
    look.misfit = misfit;
    look.faults = {{19, -0.25, -0.3, -0.2, kDetected, false},
                   {7, 0.5, 0.4, 0.6, kDetected - kSecond, true},
                   {kFirstFinding, 0.5, 0.4, 0.6, kDetected, false}};
    look.rival = LookRival{2, 40.25};
    look.observers = {7, 19};
    look.x_pct = {50.0, 50.25, 51.0, 52.0};
    look.flow = {20.0, 20.125, 21.0, 22.0};
    return look;
  }
};

TEST_F(HistoryLookTest, TheLastLookIsReadAsItWasStored) {
  HistoryWriter writer(path_);
  RecordEpisode(writer, 0b010);
  HistoryReader reader(path_);
  EXPECT_FALSE(reader.Look(Id()));
  EpisodeLook first = Look(3.0);
  first.faults.clear();
  first.rival.reset();
  first.observers.clear();
  first.x_pct.resize(2);
  first.flow.resize(2);
  writer.StoreLook(first);
  EXPECT_EQ(reader.Look(Id()), first);
  writer.StoreLook(Look(1.5));
  EXPECT_EQ(reader.Look(Id()), Look(1.5));
}

// The witness is said where the name is.
TEST_F(HistoryLookTest, AnEpisodeSaysWhatItsWitnessesSay) {
  HistoryWriter writer(path_);
  FaultEvent named = Event(TransitionKind::kIsolated, 20, 0b100, 0.8);
  named.transition.layer = Layer::kPhysics;
  writer.Record(Event(TransitionKind::kDetected, 0, 0, 0.3), kDetected);
  writer.Record(named, kDetected);
  const auto said = [this] {
    return WitnessText(HistoryReader(path_).Show("last"));
  };
  EXPECT_EQ(said(), "named by simulation of the valve");

  writer.StoreLook(Look(1.5));
  EXPECT_EQ(said(),
            "named by simulation of the valve: f19 explains it 40 times better "
            "than f2, the observers say f7 or f19");

  EpisodeLook look = Look(1.5);
  look.observers.clear();
  look.rival->times = 1.44;
  writer.StoreLook(look);
  EXPECT_EQ(said(),
            "named by simulation of the valve: f19 explains it 1.4 times "
            "better than f2, the observers are undecided");

  look.observers = {19};
  look.rival.reset();
  writer.StoreLook(look);
  EXPECT_EQ(said(), "named by simulation of the valve, the observers agree");
}

// The audit found something first, and was contradicted or not.
TEST_F(HistoryLookTest, WhatTookOverFromTheAuditSaysWhatThatFound) {
  for (const auto& [finding, certainty] :
       {std::pair{kNoResponse, Certainty::kOneOf},
        std::pair{kOscillationTuning, Certainty::kSure}}) {
    const std::string valve = FaultName(finding);
    HistoryWriter writer(path_);
    const std::vector<int> faults = models_.faults;
    models_.faults = {finding};
    const auto by_audit = [&](TransitionKind kind, double after_s,
                              EndReason reason = EndReason::kNone) {
      FaultEvent event = Event(kind, after_s, 0b1, 1.0, reason, valve);
      event.transition.layer = Layer::kAudit;
      writer.Record(event, kDetected);
    };
    by_audit(TransitionKind::kDetected, 0);
    by_audit(TransitionKind::kIsolated, 10);
    by_audit(TransitionKind::kClosed, 60, EndReason::kSuperseded);
    models_.faults = faults;
    const auto later = [&](TransitionKind kind, double after_s, FaultSet set) {
      FaultEvent event =
          Event(kind, after_s, set, 1.0, EndReason::kNone, valve);
      event.transition.detection_stamp_ns = kDetected + 55 * kSecond;
      event.episode_id =
          EpisodeId(valve, kSource, event.transition.detection_stamp_ns);
      writer.Record(event, kDetected);
    };
    later(TransitionKind::kDetected, 61, 0);
    later(TransitionKind::kIsolated, 70, 0b010);

    HistoryReader reader(path_);
    EpisodeFilter filter;
    filter.valve_glob = valve;
    const auto episodes = reader.List(filter);
    ASSERT_EQ(episodes.size(), 2U);
    EXPECT_EQ(AlarmStateOf(episodes[0]), AlarmState::kNormal);
    EXPECT_EQ(Sql("SELECT alarm_state FROM fault_history WHERE episode_id = '" +
                  episodes[0].episode_id + "'"),
              "NORMAL");
    EXPECT_EQ(episodes[1].audit, valve);
    EXPECT_EQ(CertaintyOf(episodes[1]), certainty);
    EXPECT_EQ(WitnessText(episodes[1]),
              "the audit of its loop says: " +
                  std::string(FaultFactsOf(finding).description));
    // One alarm, not two.
    filter.state = EpisodeState::kAlarmReturnedUnacked;
    EXPECT_TRUE(reader.List(filter).empty());
    const auto alarms = reader.AlarmList(kDetected);
    EXPECT_EQ(std::ranges::count(
                  alarms, valve,
                  [](const Alarm& alarm) { return alarm.episode.valve_id; }),
              1);
  }
}

TEST_F(HistoryLookTest, ItGoesWithItsEpisodeAndDoesNotComeWithoutOne) {
  HistoryWriter writer(path_);
  EXPECT_THROW(writer.StoreLook(Look(1.0)), NotFoundError);
  RecordEpisode(writer, 0b010);
  writer.StoreLook(Look(1.0));
  {
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run("DELETE FROM episode");
    transaction.Commit();
  }
  EXPECT_EQ(Sql("SELECT (SELECT count(*) FROM episode_look) + (SELECT count(*) "
                "FROM episode_look_fault) + (SELECT count(*) FROM "
                "episode_look_row)"),
            "0");
}

TEST_F(HistoryLookTest, ARowIsThatOfTheNearestSample) {
  const EpisodeLook look = Look(1.0);
  EXPECT_EQ(look.RowAt(look.first_ns - 600'000'000), std::nullopt);
  EXPECT_EQ(look.RowAt(look.first_ns - 400'000'000), 0U);
  EXPECT_EQ(look.RowAt(look.first_ns + 1'400'000'000), 1U);
  EXPECT_EQ(look.RowAt(look.first_ns + 3'400'000'000), 3U);
  EXPECT_EQ(look.RowAt(look.first_ns + 3'600'000'000), std::nullopt);
}

}  // namespace
}  // namespace fdi::storage
