// A plant shared out over monitors: by partitions, by globs, and by mistake.
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

class SharesTest : public MonitorFixture {
 protected:
  // A monitor with a data directory of its own.
  std::unique_ptr<ChildProcess> StartAnother(
      const std::string& name, const std::vector<std::string>& arguments) {
    data_ = directory_.path() / name;
    std::filesystem::create_directory(data_);
    StoreModels(data_, LinearModels());
    auto monitor = std::make_unique<ChildProcess>(Command(arguments));
    EXPECT_TRUE(monitor->AwaitLine("monitor_ready")) << monitor->errors();
    // It sends no vector before it knows of us.
    speaker_ = ":" + std::to_string(monitor->pid());
    counters_.clear();
    EXPECT_TRUE(
        Await([this] { return counters_["dds_decision_readers"] > 0; }));
    return monitor;
  }

  // Open episodes, and valves with an accumulator.
  static std::pair<int, int> OpenAndAccumulators(
      const std::filesystem::path& data) {
    storage::HistoryWriter history(data / "history.db");
    return {static_cast<int>(history.OpenEpisodes().size()),
            static_cast<int>(history.Accumulators().size())};
  }

  // Waits until the monitor's own status contains `part`.
  std::string AwaitText(const ChildProcess& monitor, const std::string& part) {
    const std::string speaker = ":" + std::to_string(monitor.pid());
    std::string text;
    EXPECT_TRUE(Await([&] {
      status_->Take({[&](const idl::MonitorStatusMessage& m, const auto&) {
                       if (m.monitor.ends_with(speaker)) {
                         text = m.text;
                       }
                     },
                     {}},
                    std::chrono::milliseconds(10));
      return text.find(part) != std::string::npos;
    })) << text;
    return text;
  }
};

TEST_F(SharesTest, TwoMonitorsThatTakeOneValveAreBothTold) {
  const auto one = StartAnother("one", {"--valve", "V*"});
  const auto two = StartAnother("two", {"--valve", "*1"});
  ASSERT_TRUE(samples_->WaitForReaders(2, kMonitorPatience));
  Publish(PlantSample(0), "V1");
  Publish(PlantSample(0), "V2");
  Publish(PlantSample(0), "W1");
  for (ChildProcess* monitor : {one.get(), two.get()}) {
    EXPECT_TRUE(monitor->AwaitLine("valves_contested id=M154"))
        << monitor->errors();
    EXPECT_TRUE(monitor->AwaitLine("valves=1 first=V1"));
    AwaitText(*monitor, "takes 1 of these valves, too: V1");
  }
}

TEST_F(SharesTest, AStandbyIsForAClusterManager) {
  for (const char* gone : {"--pair=plant", "--rank=1", "--pair-patience=1"}) {
    ChildProcess monitor(Command({gone}));
    EXPECT_EQ(monitor.AwaitExit(), 2);
    EXPECT_THAT(monitor.errors(),
                testing::HasSubstr(" is gone: let a cluster manager start"));
  }
}

TEST_F(SharesTest, APartitionIsAShareOfItsOwn) {
  StoreModels(data_, LinearModels());
  const auto usual = StartMonitor();
  const auto halls = StartAnother("halls", {"--partition", "hall-*"});
  idl::Publisher<idl::ValveSampleMessage> hall(
      *participant_, {idl::Profile::kLossless, 10, {"hall-1"}});
  ASSERT_TRUE(hall.WaitForReaders(1, kMonitorPatience));
  ASSERT_TRUE(decisions_->WaitForWriters(2, kMonitorPatience));
  hall.Write({"V1", PlantSample(0)});
  Publish(PlantSample(0), "V2");
  ASSERT_TRUE(AwaitVectors(2));
  halls->Signal(SIGTERM);
  usual->Signal(SIGTERM);
  EXPECT_EQ(halls->AwaitExit(), 0);
  EXPECT_EQ(usual->AwaitExit(), 0);
  EXPECT_TRUE(halls->AwaitLine("monitor_stopped"));
  for (const ChildProcess* monitor : {usual.get(), halls.get()}) {
    EXPECT_EQ(monitor->errors().find("valves_contested"), std::string::npos);
    EXPECT_NE(monitor->errors().find(" received=1 "), std::string::npos)
        << monitor->errors();
  }
}

// One monitor goes on with a valve where the other one stopped.
TEST_F(SharesTest, AMovedValveTakesItsEpisodeAndAccumulatorsAlong) {
  const auto from = directory_.path() / "from";
  auto monitor = StartAnother("from", {"--valve", "V*"});
  ASSERT_TRUE(samples_->WaitForReaders(1, kMonitorPatience));
  ASSERT_TRUE(events_->WaitForWriters(1, kMonitorPatience));
  for (const char* valve : {"V1", "V2"}) {
    for (std::uint64_t k = 0; k < 80; ++k) {
      Publish(PlantSample(k, k < 50 ? 0.0 : kF7Offset), valve);
    }
  }
  ASSERT_TRUE(Await([this] { return faults_.size() == 4; }));
  const auto to = directory_.path() / "to";
  const std::vector<std::string> move{
      FDI_STORE_PROGRAM, "--data", from.string(), "valves", "move", "V1",
      to.string()};
  EXPECT_EQ(ChildProcess(move).AwaitExit(), 3) << "while the monitor runs";
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0);

  EXPECT_EQ(ChildProcess(move).AwaitExit(), 0);
  EXPECT_EQ(ChildProcess(move).AwaitExit(), 5) << "there is nothing left";
  EXPECT_EQ(OpenAndAccumulators(from), (std::pair<int, int>{1, 1}));
  EXPECT_EQ(OpenAndAccumulators(to), (std::pair<int, int>{1, 1}));

  faults_.clear();
  data_ = to;
  monitor = StartMonitor({"--valve", "V1"});
  for (std::uint64_t k = 80; k < 150; ++k) {
    Publish(PlantSample(k, k < 120 ? kF7Offset : 0.0));
  }
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0);
  storage::HistoryReader history(to / "history.db");
  const std::vector<storage::Episode> episodes = history.List();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].detected_ns, PlantSample(50).stamp_ns);
  EXPECT_EQ(episodes[0].model_set, "linear@1");
  EXPECT_EQ(episodes[0].end_reason, "cleared");
  EXPECT_EQ(history.Trace(episodes[0].id).front().sample.stamp_ns,
            PlantSample(0).stamp_ns);
  std::vector<std::string> kinds;
  for (const storage::HistoryEntry& event : history.Events(episodes[0].id)) {
    kinds.push_back(event.kind);
  }
  EXPECT_THAT(kinds, testing::ElementsAre("DETECTED", "ISOLATED", "RESUMED",
                                          "CLEARED", "CLOSED"));
}

}  // namespace
}  // namespace fdi::monitor
