// A loop whose PV is a pressure, from a file to the history.
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "storage/history/history_reader.h"
#include "storage/runs/runs.h"
#include "tests/programs/simulator/process.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using PvLoopTest = MonitorFixture;

// CV winds up and down while the pressure keeps its distance from the set
// point: only who has both can know. Less than the day of one recorded run, at
// 500 samples a second: sixteen seconds, in which three audits find their turn.
constexpr int kSamples = 8'000;
// On a busy machine a few are lost on the way.
constexpr int kReceived = kSamples * 9 / 10;

double PvOf(int k) {
  return 3.1 + 0.001 * (k * 37 % 29);
}

void WriteLoop(const std::filesystem::path& path) {
  std::ofstream file(path);
  file << "t_s,CV_pct,PV,SP\n";
  for (int k = 0; k < kSamples; ++k) {
    char line[128];
    std::snprintf(line, sizeof line, "%d,%.2f,%.3f,3.6\n", 10 * k,
                  50.0 + 0.3 * std::abs(k % 200 - 100), PvOf(k));
    file << line;
  }
}

TEST_F(PvLoopTest, APressureLoopThatDoesNotAnswerHasItsEpisode) {
  const auto monitor = StartMonitor({"--record=lossless"});
  WriteLoop(data_ / "loop.csv");
  simulator::Process replay({"replay", "--file", data_ / "loop.csv", "--valve",
                             "PV-7", "--speed", "5000", "--keep-alive",
                             "--domain", std::to_string(domain_.id()), "--data",
                             data_.string()});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(Await([this] { return counters_["received"] >= kReceived; }))
      << counters_["received"];
  EXPECT_EQ(replay.Wait().code, 0);
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  storage::HistoryReader history(data_ / "history.db");
  const std::vector<storage::Episode> episodes = history.List();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].valve_id, "PV-7");
  EXPECT_EQ(episodes[0].fault, "no_response");
  EXPECT_EQ(episodes[0].layer, "audit");
  const std::vector<TracePoint> trace = history.Trace(episodes[0].id);
  ASSERT_FALSE(trace.empty());
  EXPECT_TRUE(trace.front().sample.Has(Signal::kPv));
  EXPECT_EQ(trace.front().sample[Signal::kSp], 3.6);
  storage::RunStore runs(data_ / "runs.db");
  ASSERT_EQ(runs.List().size(), 1U);
  const storage::StoredRun run = runs.Load(runs.List()[0].id);
  ASSERT_GE(run.samples.size(), std::size_t{kReceived});
  for (const storage::StoredSample& stored : run.samples) {
    const Sample& sample = stored.sample;
    ASSERT_NEAR(sample[Signal::kPv], PvOf(static_cast<int>(sample.seq)), 1e-9);
  }
}

}  // namespace
}  // namespace fdi::monitor
