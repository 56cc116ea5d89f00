// A loop whose PV is a pressure, from the lines of a gateway to the history.
#include <csignal>
#include <cstdio>

#include <gtest/gtest.h>

#include "storage/history/history_reader.h"
#include "storage/runs/runs.h"
#include "tests/programs/simulator/process.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using PvLoopTest = MonitorFixture;

// CV winds up and down while the pressure keeps its distance from the set
// point: only who has both can know.
std::string LineOf(int k) {
  const double cv = 50.0 + 0.3 * std::abs(k % 200 - 100);
  const double pv = 3.1 + 0.001 * (k * 37 % 29);
  char line[128];
  std::snprintf(line, sizeof line,
                "{\"t_s\": %d, \"CV_pct\": %.2f, \"pv\": %.3f, \"sp\": 3.6}\n",
                10 * k, cv, pv);
  return line;
}

TEST_F(PvLoopTest, APressureLoopThatDoesNotAnswerHasItsEpisode) {
  const auto monitor = StartMonitor({"--record=lossless"});
  simulator::Process replay(
      {"replay", "--file", "-", "--valve", "PV-7", "--keep-alive", "--domain",
       std::to_string(domain_.id()), "--data", data_.string()});
  const auto named = [this] {
    return !faults_.empty() &&
           faults_.back().transition.kind == TransitionKind::kIsolated;
  };
  // An audit takes as long as it takes, and there have to be three.
  const auto end = std::chrono::steady_clock::now() + kMonitorPatience;
  int k = 0;
  while (!named() && std::chrono::steady_clock::now() < end) {
    std::string lines;
    for (const int to = k + 500; k < to; ++k) {
      lines += LineOf(k);
    }
    replay.Send(lines);
    Take();
  }
  ASSERT_TRUE(named()) << monitor->errors();
  replay.CloseInput();
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
  ASSERT_EQ(run.samples.size(), static_cast<std::size_t>(k));
  EXPECT_NEAR(run.samples[7].sample[Signal::kPv], 3.1 + 0.001 * (7 * 37 % 29),
              1e-9);
}

}  // namespace
}  // namespace fdi::monitor
