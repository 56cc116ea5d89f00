#include "storage/runs/run_recorder.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "tests/storage/runs_fixture.h"

namespace fdi::storage {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

using RunRecorderTest = RunsFixture;

TEST_F(RunRecorderTest, RecordedSamplesReadBackInOrderThroughTailAndChunks) {
  constexpr int kSamples = 137;
  RunRecorder recorder(file_, {50});
  const auto a = recorder.Begin(RunOf("V1"));
  const std::string id_a = recorder.Id(a);
  const auto b = recorder.Begin(RunOf("V2"));
  const std::string id_b = recorder.Id(b);
  for (int k = 0; k < kSamples; ++k) {
    recorder.Append(a, SampleAt(k));
    recorder.Append(b, SampleAt(k, 1));
    recorder.Commit();

    // At every moment all that was committed is there, chunk or tail.
    ASSERT_EQ(Positions(id_a).size(), static_cast<std::size_t>(k + 1));
  }
  EXPECT_GT(Query("SELECT count(*) FROM tail"), 0);
  recorder.Close();

  EXPECT_EQ(Query("SELECT count(*) FROM tail"), 0);
  EXPECT_EQ(Query("SELECT max(count) FROM chunk"), 50);
  EXPECT_EQ(Query("SELECT sum(count) FROM chunk"), 2 * kSamples);
  RunStore store(file_);
  const StoredRun run = store.Load(id_b);
  ASSERT_THAT(run.samples, SizeIs(kSamples));
  for (int k = 0; k < kSamples; ++k) {
    const Sample& s = run.samples[static_cast<std::size_t>(k)].sample;
    EXPECT_EQ(s.seq, static_cast<std::uint64_t>(k));
    EXPECT_EQ(s[Signal::kCv], 51.0);
    EXPECT_EQ(s[Signal::kX], SampleAt(k).sample[Signal::kX]);
  }
  EXPECT_EQ(run.info.state, RunState::kComplete);
}

TEST_F(RunRecorderTest, ChunksOfOneSampleWaitForTheFirstOne) {
  RunRecorder recorder(file_, {1});
  const auto key = recorder.Begin(RunOf("V1"));
  const std::string id = recorder.Id(key);
  recorder.Commit();
  recorder.Append(key, SampleAt(0));
  recorder.Append(key, SampleAt(1));
  recorder.Close();

  EXPECT_THAT(Positions(id), SizeIs(2));
  EXPECT_EQ(Query("SELECT max(count) FROM chunk"), 1);
}

TEST_F(RunRecorderTest, CountersTellWhatBecameOfTheSamples) {
  RunRecorder recorder(file_);
  const auto key = recorder.Begin(RunOf("V1"));
  const std::string id = recorder.Id(key);
  for (int i = 0; i < kIntakeCount; ++i) {
    for (int n = 0; n <= i; ++n) {
      StoredSample sample = SampleAt(10 * i + n);
      sample.intake = static_cast<Intake>(i);
      sample.initialised = i == 0;
      recorder.Append(key, sample);
    }
  }
  recorder.Close();

  RunStore store(file_);
  const RunInfo info = store.Info(id);
  for (int i = 0; i < kIntakeCount; ++i) {
    EXPECT_EQ(info.intake[static_cast<std::size_t>(i)], i + 1);
  }
  EXPECT_EQ(info.samples, 45);
  EXPECT_EQ(Query("SELECT rejected FROM run_summary"), 44);
  EXPECT_EQ(info.signals, MaskOf(Signal::kCv) | MaskOf(Signal::kX));
  EXPECT_EQ(info.run.source_id, 0xFEDCBA9876543210);
  EXPECT_FALSE(info.has_truth);
  const StoredRun run = store.Load(info.id);
  EXPECT_TRUE(run.samples[0].initialised);
  EXPECT_EQ(run.samples[1].intake, Intake::kRepeat);
}

TEST_F(RunRecorderTest, WhatWasCommittedSurvivesARecorderThatDied) {
  std::string id;
  {
    RunRecorder recorder(file_, {50});
    const auto key = recorder.Begin(RunOf("V1"));
    id = recorder.Id(key);
    for (int k = 0; k < 70; ++k) {
      recorder.Append(key, SampleAt(k));
      recorder.Commit();
    }
    recorder.Append(key, SampleAt(70));  // never committed
    EXPECT_EQ(recorder.pending(), 1);
  }
  EXPECT_THAT(Positions(id), SizeIs(70));
  EXPECT_EQ(RunStore(file_).Info(id).state, RunState::kInterrupted);
  EXPECT_GT(Query("SELECT count(*) FROM tail"), 0);

  RunRecorder next(file_);
  EXPECT_THAT(Positions(id), SizeIs(70));
  EXPECT_EQ(Query("SELECT count(*) FROM tail"), 0);
  EXPECT_EQ(Query("SELECT count(*) FROM run WHERE state = 'interrupted'"), 1);
}

TEST_F(RunRecorderTest, ADamagedTailDoesNotStopTheNextRecorder) {
  std::vector<std::string> ids;
  {
    RunRecorder recorder(file_);
    for (const char* valve : {"V1", "V2"}) {
      const auto key = recorder.Begin(RunOf(valve));
      ids.push_back(recorder.Id(key));
      recorder.Append(key, SampleAt(0));
    }
    recorder.Commit();
  }
  {
    RunStore store(file_, Access::kOccasionalWriter);
    Transaction transaction(store.database());
    store.database().Run("UPDATE tail SET crc = crc + 1 WHERE run_id = 1");
    transaction.Commit();
  }
  RunRecorder next(file_);
  EXPECT_EQ(Query("SELECT count(*) FROM run WHERE state = 'interrupted'"), 2);
  EXPECT_THAT(Positions(ids[1]), SizeIs(1));
  EXPECT_THAT(MessageOf<DataError>([&] { Positions(ids[0]); }),
              HasSubstr(ids[0]));
  EXPECT_TRUE(next.database().Checkpoint());
}

TEST_F(RunRecorderTest, KillingTheRecorderLosesNothingCommitted) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const pid_t child = fork();
  if (child == 0) {
    RunRecorder recorder(file_, {50});
    const auto key = recorder.Begin(RunOf("V1"));
    for (int k = 0; k < 130; ++k) {
      recorder.Append(key, SampleAt(k));
      recorder.Commit();
    }
    recorder.Append(key, SampleAt(130));
    if (write(pipe_ends[1], "x", 1) == 1) {
      pause();
    }
    _exit(1);
  }
  char ready = 0;
  ASSERT_EQ(read(pipe_ends[0], &ready, 1), 1);
  EXPECT_EQ(RunStore(file_).List().at(0).state, RunState::kRecording);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(pipe_ends[0]);
  close(pipe_ends[1]);

  const RunInfo info = RunStore(file_).List().at(0);
  EXPECT_EQ(info.state, RunState::kInterrupted);
  EXPECT_EQ(info.samples, 130);
  EXPECT_THAT(Positions(info.id), SizeIs(130));
}

TEST_F(RunRecorderTest, ALivingRecorderIsLeftAloneByTheNext) {
  RunRecorder first(file_);
  const auto key = first.Begin(RunOf("V1"));
  const std::string id = first.Id(key);
  first.Append(key, SampleAt(0));
  first.Commit();
  RunRecorder second(file_);

  EXPECT_EQ(RunStore(file_).Info(id).state, RunState::kRecording);
  RunStore store(file_, Access::kOccasionalWriter);
  EXPECT_THAT(MessageOf<DataError>([&] { store.Delete(id); }),
              HasSubstr("is being recorded"));
  first.Append(key, SampleAt(1));
  first.Close();
  EXPECT_THAT(Positions(id), ElementsAre(0, 1));
}

TEST_F(RunRecorderTest, PendingSamplesSurviveACommitThatFails) {
  RunRecorder recorder(file_);
  const auto key = recorder.Begin(RunOf("V1"));
  const std::string id = recorder.Id(key);
  recorder.Append(key, SampleAt(0));
  recorder.database().Prepare("PRAGMA query_only = ON").Step();
  EXPECT_THROW(recorder.Commit(), SqliteError);
  EXPECT_EQ(recorder.pending(), 1);

  recorder.database().Prepare("PRAGMA query_only = OFF").Step();
  recorder.Append(key, SampleAt(1));
  recorder.Close();
  EXPECT_EQ(recorder.recorded(), 2);
  EXPECT_THAT(Positions(id), ElementsAre(0, 1));
}

TEST_F(RunRecorderTest, NothingIsHeldOfARunWhoseEndIsCommitted) {
  RunRecorder recorder(file_);
  for (int day = 0; day < 3; ++day) {
    const auto key = recorder.Begin(RunOf("V1"));
    recorder.Append(key, SampleAt(day));
    recorder.End(key);
    EXPECT_NO_THROW(recorder.Id(key));
    recorder.Commit();

    EXPECT_THROW(recorder.Id(key), std::invalid_argument);
    EXPECT_NO_THROW(recorder.End(key));  // Again: a no-op.
  }
  EXPECT_EQ(recorder.recorded(), 3);
}

}  // namespace
}  // namespace fdi::storage
