#include "storage/history/retention.h"

#include <thread>

#include <gmock/gmock.h>

#include "base/time_text.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/storage/history_fixture.h"

namespace fdi::storage {
namespace {

using testing::ElementsAre;

class HistoryRetentionTest : public HistoryFixture {
 protected:
  HistoryRetentionTest() {
    for (const char* valve : {"acked", "unacked", "labelled", "late"}) {
      RecordEpisode(writer_, 0b010, valve);
    }
    writer_.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, "open"),
        kDetected);
    MarkAllSent();
    HistoryEditor editor(path_);
    for (const char* valve : {"acked", "labelled", "late", "open"}) {
      editor.Acknowledge(EpisodeIdText(Id(valve)), By("anna", 1));
    }
    editor.Label(EpisodeIdText(Id("labelled")), "true", By("anna", 1));
  }

  void MarkAllSent() {
    for (const FaultEvent& event : writer_.UnsentEvents()) {
      writer_.MarkSent(event);
    }
    writer_.Commit(kDetected);
  }
  std::vector<std::string> Valves() {
    std::vector<std::string> valves;
    for (const Episode& episode : HistoryReader(path_).List()) {
      valves.push_back(episode.valve_id);
    }
    return valves;
  }
  static RetentionLimits Before(std::int64_t ns) {
    RetentionLimits limits;
    limits.before_ns = ns;
    return limits;
  }
  static constexpr std::int64_t kEnded = kDetected + 91 * kSecond;

  HistoryWriter writer_{path_};
};

TEST_F(HistoryRetentionTest, OnlyWhatIsClosedAcknowledgedAndUnlabelledGoes) {
  const PruneResult result = PruneHistory(path_, Before(kEnded + 1));

  EXPECT_EQ(result.deleted, 2);
  EXPECT_EQ(result.kept, 3);
  EXPECT_EQ(result.from_ns, kDetected);
  EXPECT_THAT(Valves(), ElementsAre("labelled", "open", "unacked"));
  EXPECT_EQ(Sql("SELECT count(*) FROM episode_event WHERE episode_id NOT IN "
                "(SELECT episode_id FROM episode)"),
            "0");
  EXPECT_TRUE(writer_.database().Check().empty());
}

// Nobody acknowledges it.
TEST_F(HistoryRetentionTest, ANoticeGoesOnceItIsOver) {
  for (const auto kind : {TransitionKind::kDetected, TransitionKind::kClosed}) {
    FaultEvent event = Event(kind, 90, 0, 0.3, EndReason::kCleared, "notice");
    event.transition.notice = true;
    writer_.Record(event, kDetected);
    const bool over = kind == TransitionKind::kClosed;
    RetentionLimits limits = Before(kEnded + 1);
    limits.dry_run = true;
    const PruneResult result = PruneHistory(path_, limits);
    EXPECT_EQ(result.deleted, over ? 3 : 2);
    EXPECT_EQ(result.kept, over ? 3 : 4);
  }
}

TEST_F(HistoryRetentionTest, WhatEndedLaterStays) {
  EXPECT_EQ(PruneHistory(path_, Before(kEnded)).deleted, 0);
  EXPECT_EQ(Valves().size(), 5U);
}

// An episode of a publisher whose clock says 1970, or 2049, is as old as its
// arrival.
TEST_F(HistoryRetentionTest, AgeIsThatOfTheArrivalWhereAClockWasWrong) {
  using Kind = TransitionKind;
  constexpr std::int64_t kYears = 20LL * 365 * 86400 * kSecond;
  for (const std::int64_t off_ns : {-kYears, kYears}) {
    const std::string valve = off_ns < 0 ? "behind" : "ahead";
    for (const Kind kind : {Kind::kDetected, Kind::kClosed}) {
      FaultEvent event =
          Event(kind, kind == Kind::kClosed ? 91 : 0, 0, 0.3,
                kind == Kind::kClosed ? EndReason::kCleared : EndReason::kNone,
                valve);
      event.transition.stamp_ns += off_ns;
      event.transition.detection_stamp_ns += off_ns;
      writer_.Record(event, kDetected + 300 * kSecond);
    }
    HistoryEditor(path_).Acknowledge(EpisodeIdText(Id(valve)), By("anna", 1));
  }
  MarkAllSent();

  PruneHistory(path_, Before(kDetected + 200 * kSecond));
  EXPECT_THAT(Valves(), testing::IsSupersetOf({"behind", "ahead"}));
  PruneHistory(path_, Before(kDetected + 400 * kSecond));
  EXPECT_THAT(Valves(), testing::Not(testing::Contains("behind")));
  EXPECT_THAT(Valves(), testing::Not(testing::Contains("ahead")));
}

TEST_F(HistoryRetentionTest, ADryRunTellsTheSameAndDeletesNothing) {
  RetentionLimits limits = Before(kEnded + 1);
  limits.dry_run = true;

  const PruneResult result = PruneHistory(path_, limits);

  EXPECT_EQ(result.deleted, 2);
  EXPECT_EQ(result.kept, 3);
  EXPECT_EQ(Valves().size(), 5U);
}

TEST_F(HistoryRetentionTest, AnEventThatWasNotSentKeepsItsEpisode) {
  RecordEpisode(writer_, 0b010, "unsent");
  HistoryEditor(path_).Acknowledge(EpisodeIdText(Id("unsent")), By("anna", 1));

  PruneHistory(path_, Before(kEnded + 1));

  EXPECT_THAT(Valves(), testing::Contains("unsent"));
}

TEST_F(HistoryRetentionTest, SizeIsReachedAsFarAsItIsNotProtected) {
  RetentionLimits limits;
  limits.max_bytes = 1;

  const PruneResult result = PruneHistory(path_, limits);

  EXPECT_EQ(result.deleted, 2);
  EXPECT_FALSE(result.fits);
  EXPECT_LE(result.bytes_after, result.bytes_before);
}

class RunRetentionTest : public testing::Test {
 protected:
  static constexpr std::int64_t kStart = 1'700'000'000'000'000'000;
  static constexpr std::int64_t kDay = 86'400'000'000'000;

  static NewRun RunOn(int day, RunOrigin origin = RunOrigin::kRecorded) {
    NewRun run;
    run.valve_id = "V1";
    run.start_ns = kStart + day * kDay;
    run.period_s = 1.0;
    run.origin = origin;
    run.software = "test";
    return run;
  }
  static void Append(RunRecorder& recorder, RunRecorder::Key run, int day,
                     int count = 2000) {
    for (int k = 0; k < count; ++k) {
      StoredSample stored;
      stored.sample.stamp_ns = kStart + day * kDay + k * 1'000'000'000LL;
      stored.sample.seq = static_cast<std::uint64_t>(k);
      stored.sample.Set(Signal::kX, k * 0.37 + 1.0 / (k + 1.0));
      recorder.Append(run, stored);
    }
  }
  std::vector<int> Days() {
    std::vector<int> days;
    for (const RunInfo& info : RunStore(file_).List()) {
      days.push_back(static_cast<int>((info.run.start_ns - kStart) / kDay));
    }
    return days;
  }

  TemporaryDirectory directory_;
  const std::filesystem::path file_{directory_.path() / "runs.db"};
};

// A run that a publisher stamps 1970 or 2049 is as old as its arrival, which is
// the time at which this test runs.
TEST_F(RunRetentionTest, AgeIsThatOfTheArrivalWhereAClockWasWrong) {
  RunRecorder recorder(file_);
  const auto now_day = static_cast<int>((NowNs() - kStart) / kDay);
  constexpr int kYears = 20 * 365;
  for (const int off : {-kYears, kYears}) {
    const auto run = recorder.Begin(RunOn(now_day + off));
    Append(recorder, run, now_day + off, 10);
    recorder.End(run);
  }
  recorder.Close();
  const auto deleted = [this](std::int64_t before_ns) {
    RetentionLimits limits;
    limits.before_ns = before_ns;
    limits.dry_run = true;
    return PruneRuns(file_, limits).deleted;
  };

  EXPECT_EQ(deleted(NowNs() - kDay), 0);
  EXPECT_EQ(deleted(NowNs() + kDay), 2);
}

// One of four recorded days bears a label, and one is being recorded.
TEST_F(RunRetentionTest, TheOldestRecordedRunsGoUntilTheSizeFits) {
  RunRecorder recorder(file_);
  std::vector<RunRecorder::Key> keys;
  for (int day = 0; day < 4; ++day) {
    keys.push_back(recorder.Begin(RunOn(day)));
    Append(recorder, keys.back(), day);
    if (day < 3) {
      recorder.End(keys.back());
    }
  }
  const std::string first = recorder.Id(keys[0]);
  const auto simulated = recorder.Begin(RunOn(5, RunOrigin::kSimulated));
  Append(recorder, simulated, 5);
  recorder.End(simulated);
  recorder.Commit();
  RunStore(file_, Access::kOccasionalWriter).Label(first, 7, 0.5);

  const auto pages = recorder.database().QueryInt64("PRAGMA page_count");
  RetentionLimits limits;
  limits.max_bytes = recorder.database().UsedBytes() - 1;
  const PruneResult one = PruneRuns(file_, limits);
  EXPECT_EQ(one.deleted, 1);
  EXPECT_TRUE(one.fits);
  EXPECT_THAT(Days(), ElementsAre(0, 2, 3, 5));

  limits.max_bytes = 1;
  EXPECT_EQ(PruneRuns(file_, limits).deleted, 1);
  EXPECT_THAT(Days(), ElementsAre(0, 3, 5));
  // The file is used again instead of growing.
  const auto next = recorder.Begin(RunOn(6));
  Append(recorder, next, 6);
  recorder.Close();
  EXPECT_LE(recorder.database().QueryInt64("PRAGMA page_count"), pages);
  EXPECT_TRUE(recorder.database().Check().empty());
}

TEST_F(RunRetentionTest, RecordingGoesOnWhileRunsAreDeleted) {
  RunRecorder recorder(file_);
  for (int day = 0; day < 20; ++day) {
    const auto run = recorder.Begin(RunOn(day));
    Append(recorder, run, day, 500);
    recorder.End(run);
  }
  recorder.Commit();
  const auto live = recorder.Begin(RunOn(30));
  RetentionLimits limits;
  limits.before_ns = std::numeric_limits<std::int64_t>::max();
  PruneResult result;

  std::thread pruner([&] { result = PruneRuns(file_, limits); });
  for (int k = 0; k < 20; ++k) {
    Append(recorder, live, 30, 10);
    EXPECT_NO_THROW(recorder.Commit());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  pruner.join();
  recorder.Close();

  EXPECT_EQ(result.deleted, 20);
  EXPECT_THAT(Days(), ElementsAre(30));
  EXPECT_EQ(RunStore(file_).List()[0].samples, 200);
}

}  // namespace
}  // namespace fdi::storage
