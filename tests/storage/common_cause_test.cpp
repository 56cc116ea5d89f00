#include "storage/history/common_cause.h"

#include <gtest/gtest.h>

#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using Kind = CauseChange::Kind;

// Five valves on a header; the demo models know f1, f7, f19: bits 1, 2, 4.
class CommonCauseTest : public HistoryFixture {
 protected:
  CommonCauseTest() {
    CauseGroup group;
    group.name = "header west";
    group.valve_globs = {"A-*"};
    group.faults = {"f7", "f19"};
    group.min_valves = 3;
    group.within_ns = 60 * kSecond;
    groups_ = {group};
    Reopen();
  }

  // As a monitor that is started anew.
  void Reopen() {
    book_.reset();
    writer_.reset();
    writer_.emplace(path_);
    book_.emplace(writer_->database(), groups_);
  }

  std::vector<CauseChange> Isolate(const std::string& valve, double at_s,
                                   FaultSet faults = 4) {
    writer_->CommitBatch([&] {
      writer_->Record(
          Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
          kDetected);
      writer_->Record(Event(TransitionKind::kIsolated, at_s, faults, 0.8,
                            EndReason::kNone, valve),
                      kDetected);
    });
    return book_->Read();
  }
  // Likewise, but nobody is alarmed by it until it is raised.
  std::vector<CauseChange> IsolateNotice(const std::string& valve, double at_s,
                                         FaultSet faults = 4) {
    for (const bool isolated : {false, true}) {
      FaultEvent event = Event(
          isolated ? TransitionKind::kIsolated : TransitionKind::kDetected,
          isolated ? at_s : 0, isolated ? faults : 0, 0.8, EndReason::kNone,
          valve);
      event.transition.notice = true;
      writer_->Record(event, kDetected);
    }
    return book_->Read();
  }
  std::vector<CauseChange> Raise(const std::string& valve, double at_s,
                                 FaultSet faults = 4) {
    writer_->Record(Event(TransitionKind::kRaised, at_s, faults, 0.8,
                          EndReason::kNone, valve),
                    kDetected);
    return book_->Read();
  }
  std::vector<CauseChange> Close(const std::string& valve, double at_s) {
    writer_->Record(Event(TransitionKind::kClosed, at_s, 4, 0.1,
                          EndReason::kCleared, valve),
                    kDetected);
    return book_->Read();
  }
  std::vector<CommonCause> Causes() {
    return ReadCommonCauses(writer_->database(), 0);
  }

  std::vector<CauseGroup> groups_;
  std::optional<HistoryWriter> writer_;
  std::optional<CommonCauseBook> book_;
};

TEST_F(CommonCauseTest, ThreeValvesOfAGroupWithinTheTimeAreOneCause) {
  EXPECT_TRUE(Isolate("A-1", 10).empty());
  EXPECT_TRUE(Isolate("A-2", 30, 2).empty());
  const auto changes = Isolate("A-3", 65);

  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, Kind::kOpened);
  EXPECT_EQ(changes[0].cause.group, "header west");
  EXPECT_EQ(changes[0].cause.opened_ns, kDetected + 65 * kSecond);
  ASSERT_EQ(changes[0].cause.members.size(), 3u);
  EXPECT_EQ(changes[0].cause.members[1].fault, "f7");
}

TEST_F(CommonCauseTest, OthersFaultsValvesOrTimesAreNone) {
  Isolate("A-1", 10);
  Isolate("A-2", 20, 1);  // f1
  Isolate("B-1", 20);     // another group
  Isolate("A-3", 71);     // 61 s after the first
  EXPECT_TRUE(Isolate("A-4", 72, 1).empty());
  EXPECT_TRUE(Causes().empty());
  EXPECT_TRUE(Isolate("A-5", 70).empty());
  // 56 s before A-3, whatever order they are recorded in.
  EXPECT_EQ(Isolate("A-6", 15).size(), 1u);
}

TEST_F(CommonCauseTest, AnOpenCauseGrowsAndEndsWithItsLastEpisode) {
  Isolate("A-1", 10);
  Isolate("A-2", 11);
  Isolate("A-3", 12);
  const auto grown = Isolate("A-4", 500);
  ASSERT_EQ(grown.size(), 1u);
  EXPECT_EQ(grown[0].kind, Kind::kGrown);
  EXPECT_EQ(grown[0].cause.members.size(), 4u);

  EXPECT_TRUE(Close("A-1", 600).empty());
  EXPECT_TRUE(Close("A-2", 700).empty());
  EXPECT_TRUE(Close("A-4", 800).empty());
  const auto ended = Close("A-3", 750);
  ASSERT_EQ(ended.size(), 1u);
  EXPECT_EQ(ended[0].kind, Kind::kEnded);
  EXPECT_EQ(ended[0].cause.ended_ns, kDetected + 800 * kSecond);
  EXPECT_EQ(Causes().size(), 1u);
}

TEST_F(CommonCauseTest, ANoticeCountsOnceItIsRaisedAsOfItsIsolation) {
  IsolateNotice("A-1", 10);
  Isolate("A-2", 20);
  EXPECT_TRUE(Isolate("A-3", 30).empty());

  const auto changes = Raise("A-1", 3600);
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].kind, Kind::kOpened);
  EXPECT_EQ(changes[0].cause.opened_ns, kDetected + 30 * kSecond);
  EXPECT_EQ(changes[0].cause.members.size(), 3u);
}

TEST_F(CommonCauseTest, ANoticeThatIsRaisedJoinsAnOpenCause) {
  IsolateNotice("A-1", 5);
  Isolate("A-2", 10);
  EXPECT_TRUE(Isolate("A-3", 11).empty());
  EXPECT_EQ(Isolate("A-4", 12).size(), 1u);
  IsolateNotice("A-5", 500);
  EXPECT_EQ(Causes().at(0).members.size(), 3u);

  EXPECT_EQ(Raise("A-1", 3600).at(0).kind, Kind::kGrown);
  EXPECT_EQ(Raise("A-5", 3600).at(0).kind, Kind::kGrown);
  EXPECT_EQ(Causes().at(0).members.size(), 5u);
}

// The group holds two faults and has the one that came later.
TEST_F(CommonCauseTest, ANoticeMayHaveGotTheFaultOfTheGroupLater) {
  IsolateNotice("A-1", 10, 1);
  FaultEvent event =
      Event(TransitionKind::kReisolated, 100, 5, 0.8, EndReason::kNone, "A-1");
  event.transition.notice = true;
  writer_->Record(event, kDetected);
  Isolate("A-2", 110);
  EXPECT_TRUE(Isolate("A-3", 120).empty());
  EXPECT_EQ(Raise("A-1", 3600, 5).size(), 1u);
}

TEST_F(CommonCauseTest, ARestartBetweenTwoValvesChangesNothing) {
  Isolate("A-1", 10);
  Isolate("A-2", 11);
  Reopen();
  EXPECT_EQ(Isolate("A-3", 12).size(), 1u);
  Reopen();
  EXPECT_EQ(Isolate("A-4", 13).at(0).kind, Kind::kGrown);
  Close("A-1", 600);
  Close("A-2", 600);
  Close("A-3", 600);
  Reopen();
  EXPECT_EQ(Close("A-4", 601).at(0).kind, Kind::kEnded);
}

TEST_F(CommonCauseTest, WhatEndedWhileNobodyLookedIsEndedLater) {
  for (const char* valve : {"A-1", "A-2", "A-3"}) {
    Isolate(valve, 10);
  }
  for (const char* valve : {"A-1", "A-2", "A-3"}) {
    writer_->Record(
        Event(TransitionKind::kClosed, 90, 4, 0.1, EndReason::kCleared, valve),
        kDetected);
  }
  EXPECT_EQ(book_->Read().at(0).kind, Kind::kEnded);
  EXPECT_EQ(Causes().at(0).ended_ns, kDetected + 90 * kSecond);
}

TEST_F(CommonCauseTest, ToldTwiceIsToldOnce) {
  Isolate("A-1", 10);
  Isolate("A-2", 11);
  EXPECT_EQ(Isolate("A-3", 12).size(), 1u);
  EXPECT_TRUE(Isolate("A-3", 12).empty());
  EXPECT_TRUE(Isolate("A-1", 10).empty());
  EXPECT_EQ(Causes().at(0).members.size(), 3u);
}

TEST_F(CommonCauseTest, OpenOnesCountHoweverOldTheyAre) {
  Isolate("A-1", 10);
  Isolate("A-2", 11);
  Isolate("A-3", 12);
  const std::int64_t later = kDetected + 100 * kSecond;
  EXPECT_EQ(ReadCommonCauses(writer_->database(), later).size(), 1u);
  Transaction transaction(writer_->database());
  writer_->database().Run("UPDATE common_cause SET ended_ns = ?", later);
  transaction.Commit();
  EXPECT_TRUE(ReadCommonCauses(writer_->database(), later).empty());
  EXPECT_EQ(ReadCommonCauses(writer_->database(), kDetected).size(), 1u);
}

}  // namespace
}  // namespace fdi::storage
