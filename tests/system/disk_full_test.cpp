// The built fdi-monitor while it can store nothing: a small file system that is
// full, and a limit on the size of files. It must go on diagnosing, say that it
// is degraded, and store again once it can.

#include <csignal>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "storage/history/history_reader.h"
#include "storage/runs/runs.h"
#include "tests/storage/small_disk.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

class DiskFullTest : public MonitorFixture {
 protected:
  /// Samples and one episode before, during and after the trouble.
  template <typename Begin, typename End>
  void LiveThrough(Begin begin_trouble, End end_trouble) {
    StoreModels(data_, LinearModels());
    const auto monitor = StartMonitor({"--record"});
    Publish(0, 50);
    ASSERT_TRUE(Await([this] { return counters_["recorded"] >= 40; }));

    begin_trouble(*monitor);
    Publish(50, 80, kF7Offset);
    ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
    EXPECT_FALSE(faults_.back().persisted);
    for (std::uint64_t k = 80; k < 3080; ++k) {
      Publish(PlantSample(k, kF7Offset));
    }
    ASSERT_TRUE(AwaitVectors(3080)) << vectors_.size();
    ASSERT_TRUE(Await([this] { return health_ == idl::Health::kDegraded; }));
    ASSERT_TRUE(Await([this] { return counters_["record_failures"] > 0; }));
    EXPECT_THAT(monitor->errors(),
                testing::Not(testing::HasSubstr("persistence_recovered")));

    end_trouble(*monitor);
    ASSERT_TRUE(monitor->AwaitLine("persistence_recovered"));
    Publish(3080, 3150);
    ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
    EXPECT_TRUE(faults_.back().persisted) << monitor->errors();
    ASSERT_TRUE(monitor->AwaitLine("recording_recovered"));
    ASSERT_TRUE(Await([this] { return health_ == idl::Health::kOk; }));
    monitor->Signal(SIGTERM);
    EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
    ExpectSoundAndComplete();
  }

  void ExpectSoundAndComplete() {
    storage::HistoryReader history(data_ / "history.db");
    EXPECT_TRUE(history.database().Check().empty());
    const auto episodes = history.List();
    ASSERT_EQ(episodes.size(), 1U);
    std::vector<std::string> kinds;
    for (const storage::HistoryEntry& event : history.Events(episodes[0].id)) {
      kinds.push_back(event.kind);
    }
    EXPECT_THAT(kinds, testing::ElementsAre("DETECTED", "ISOLATED", "CLEARED",
                                            "CLOSED"));
    std::vector<std::string> reasons;
    for (const DataGap& gap : history.Gaps()) {
      reasons.push_back(gap.reason);
    }
    EXPECT_THAT(reasons, testing::Contains("persistence_degraded"));

    storage::RunStore runs(data_ / "runs.db");
    EXPECT_TRUE(runs.database().Check().empty());
    ASSERT_EQ(runs.List().size(), 1U);
    // Kept in memory meanwhile: the backlog holds 200 000 samples.
    EXPECT_EQ(runs.List()[0].samples, 3150);
  }
};

TEST_F(DiskFullTest, AFullDiskStopsNeitherDiagnosisNorPublication) {
  const storage::SmallDisk disk(directory_.path() / "disk", "4M");
  if (!disk.mounted()) {
    GTEST_SKIP() << "mounting a file system is not permitted";
  }
  data_ = disk.path();
  LiveThrough([&](const ChildProcess&) { disk.Fill(); },
              [&](const ChildProcess&) { disk.Free(); });
}

TEST_F(DiskFullTest, AWriteThatFailsStopsNeitherDiagnosisNorPublication) {
  const auto limit_files = [](const ChildProcess& monitor, rlim_t bytes) {
    const rlimit limit{bytes, RLIM_INFINITY};
    ASSERT_EQ(prlimit(monitor.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  };
  LiveThrough([&](const ChildProcess& monitor) { limit_files(monitor, 1000); },
              [&](const ChildProcess& monitor) {
                limit_files(monitor, RLIM_INFINITY);
              });
}

TEST_F(DiskFullTest, AMonitorThatEndsWithoutHavingStoredSaysSo) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartMonitor({"--record"});
  Publish(0, 50);
  ASSERT_TRUE(Await([this] { return counters_["recorded"] >= 40; }));
  const rlimit limit{1000, RLIM_INFINITY};
  ASSERT_EQ(prlimit(monitor->pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  monitor->Signal(SIGTERM);

  EXPECT_EQ(monitor->AwaitExit(), 3) << monitor->errors();
}

}  // namespace
}  // namespace fdi::monitor
