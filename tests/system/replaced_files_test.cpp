// The built fdi-monitor while somebody deletes or replaces its databases: what
// it says is stored is in the file that has the name.
#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time_text.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using testing::Contains;
using testing::ElementsAre;

class ReplacedFilesTest : public MonitorFixture {};

TEST_F(ReplacedFilesTest, ADeletedHistoryIsMadeAnewWithWhatIsOpen) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartMonitor();
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(faults_.back().persisted);

  for (const char* name : {"history.db", "history.db-wal", "history.db-shm"}) {
    std::filesystem::remove(data_ / name);
  }
  ASSERT_TRUE(Await([this] { return health_ == idl::Health::kDegraded; }));
  ASSERT_TRUE(monitor->AwaitLine("persistence_degraded")) << monitor->errors();
  EXPECT_THAT(monitor->errors(), testing::HasSubstr("deleted or replaced"));
  ASSERT_TRUE(monitor->AwaitLine("persistence_recovered")) << monitor->errors();
  {
    storage::HistoryReader history(data_ / "history.db");
    ASSERT_EQ(history.List().size(), 1U);
    EXPECT_FALSE(history.List()[0].ended_ns);
    EXPECT_EQ(history.List()[0].fault, "f7");
  }
  Publish(80, 150);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
  EXPECT_TRUE(faults_.back().persisted);
  ASSERT_TRUE(Await([this] { return health_ == idl::Health::kOk; }));
  monitor->Signal(SIGTERM);

  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  storage::HistoryReader history(data_ / "history.db");
  EXPECT_TRUE(history.database().Check().empty());
  ASSERT_EQ(history.List().size(), 1U);
  std::vector<std::string> kinds;
  for (const auto& event : history.Events(history.List()[0].id)) {
    kinds.push_back(event.kind);
  }
  EXPECT_THAT(kinds, ElementsAre("ISOLATED", "CLEARED", "CLOSED"));
  std::vector<std::string> reasons;
  for (const DataGap& gap : history.Gaps()) {
    reasons.push_back(gap.reason);
  }
  EXPECT_THAT(reasons, Contains("persistence_degraded"));
}

// "They are temporary files." Meanwhile an operator shelves the alarm.
TEST_F(ReplacedFilesTest, DeletedLogsCostNothing) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartMonitor({"--record"});
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(Await([this] { return counters_["recorded"] == 80; }));
  for (const char* file :
       {"history.db-wal", "history.db-shm", "runs.db-wal", "runs.db-shm"}) {
    ASSERT_TRUE(std::filesystem::remove(data_ / file)) << file;
  }
  storage::HistoryEditor(data_ / "history.db")
      .Shelve("V1", std::nullopt, NowNs() + 3'600'000'000'000,
              {"anna", "", "test", NowNs()});
  Publish(80, 150);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
  EXPECT_TRUE(faults_.back().persisted);
  ASSERT_TRUE(Await([this] { return counters_["recorded"] == 150; }));
  monitor->Signal(SIGTERM);

  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  EXPECT_EQ(monitor->errors().find("degraded"), std::string::npos);
  storage::HistoryReader history(data_ / "history.db");
  EXPECT_TRUE(history.database().Check().empty());
  ASSERT_EQ(history.List().size(), 1U);
  EXPECT_TRUE(history.List()[0].ended_ns);
  ASSERT_EQ(history.Shelves(std::nullopt).size(), 1U);
  storage::RunStore runs(data_ / "runs.db");
  EXPECT_TRUE(runs.database().Check().empty());
  ASSERT_EQ(runs.List().size(), 1U);
  EXPECT_EQ(runs.List()[0].samples, 150);
}

// Moved into place as a backup is, with the WAL of the old file left beside it.
TEST_F(ReplacedFilesTest, RecordingGoesOnInTheFileThatReplacesRuns) {
  StoreModels(data_, LinearModels());
  {
    storage::RunRecorder other(data_ / "other.db");
    storage::NewRun run;
    run.valve_id = "OTHER";
    run.period_s = 1.0;
    const auto key = other.Begin(run);
    other.Append(key, LabelledSample{PlantSample(0), {}});
    other.Close();
  }
  const auto monitor = StartMonitor({"--record"});
  Publish(0, 50);
  ASSERT_TRUE(Await([this] { return counters_["recorded"] == 50; }));

  std::filesystem::rename(data_ / "other.db", data_ / "runs.db");
  ASSERT_TRUE(Await([this] { return health_ == idl::Health::kDegraded; }));
  ASSERT_TRUE(monitor->AwaitLine("record_failed")) << monitor->errors();
  EXPECT_THAT(monitor->errors(), testing::HasSubstr("deleted or replaced"));
  Publish(50, 90);
  ASSERT_TRUE(Await([this] { return counters_["recorded"] == 90; }));
  ASSERT_TRUE(Await([this] { return health_ == idl::Health::kOk; }));
  monitor->Signal(SIGTERM);

  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  storage::RunStore runs(data_ / "runs.db");
  EXPECT_TRUE(runs.database().Check().empty());
  const auto stored = runs.List();
  ASSERT_EQ(stored.size(), 2U);
  const auto& own = stored[stored[0].run.valve_id == "OTHER" ? 1 : 0];
  EXPECT_EQ(own.samples, 40);
  EXPECT_EQ(own.run.start_ns, PlantSample(50).stamp_ns);
  EXPECT_EQ(own.state, storage::RunState::kComplete);
}

}  // namespace
}  // namespace fdi::monitor
