// A pair of monitors on loopback whose leader is killed, stopped and ended.
#include <csignal>
#include <fstream>
#include <memory>

#include <gtest/gtest.h>

#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "tests/idl/test_domain.h"
#include "tests/storage/temporary_directory.h"
#include "tests/survival/kill_rounds.h"
#include "tests/survival/pair_plant.h"
#include "tests/system/monitor_process.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr int kValves = 50;
constexpr std::size_t kFaulty = 5;

class PairTest : public testing::Test {
 protected:
  static constexpr int kRanks = 2;

  PairTest() : plant_(domain_.Options(), kValves, kFaulty, milliseconds(100)) {
    for (int i = 0; i < kRanks; ++i) {
      StorePairModels(data_[i].path());
      Start(i);
    }
  }

  void Start(int i) {
    monitors_[i] = std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--data", data_[i].path().string(), "--domain",
        std::to_string(domain_.id()), "run", "--pair", "test", "--rank",
        std::to_string(i + 1)});
    ASSERT_TRUE(monitors_[i]->AwaitLine("monitor_ready"))
        << monitors_[i]->errors();
  }

  /// Waits until both are ready. @returns which one leads.
  int Leader() {
    EXPECT_TRUE(Await([this] { return plant_.Settled(); }));
    const auto leaders = plant_.Leaders();
    for (int i = 0; i < kRanks; ++i) {
      if (leaders == std::vector{std::to_string(monitors_[i]->pid())}) {
        return i;
      }
    }
    ADD_FAILURE() << "nobody leads";
    return 0;
  }

  void BeginEpisodes() {
    Leader();
    plant_.CountFromNow();
    plant_.SetFaulty(true);
    ASSERT_TRUE(Await([this] { return plant_.Isolated() == kFaulty; }));
  }

  /// What the take-over since `from` cost subscribers.
  void ExpectTakeOver(Clock::time_point from) {
    ASSERT_TRUE(Await([&] { return plant_.NextVectors(from).missing == 0; }))
        << plant_.NextVectors(from).missing << " valves are silent";
    const PairPlant::Delay delay = plant_.NextVectors(from);
    std::printf("next vectors after %.0f ms (median), %.0f ms (worst)\n",
                delay.median, delay.worst);
    EXPECT_LE(delay.median, 500.0);
    EXPECT_LE(delay.worst, 1000.0);
  }

  /// No sample without a vector, no transition twice, one episode a valve on
  /// the bus and in both histories.
  void ExpectWhole() {
    std::this_thread::sleep_for(milliseconds(3500));
    const PairPlant::Totals totals = plant_.Count();
    std::printf(
        "%zu samples, %zu missing, %zu twice; %zu transitions of %zu "
        "episodes, %zu repeats\n",
        totals.samples, totals.missing, totals.twice, totals.transitions,
        totals.episodes, totals.repeats);
    EXPECT_GT(totals.samples, kValves * 10U);
    EXPECT_EQ(totals.missing, 0U);
    EXPECT_EQ(totals.transitions_twice, 0U);
    EXPECT_EQ(totals.episodes, kFaulty);
    for (const storage::TemporaryDirectory& data : data_) {
      EXPECT_EQ(
          storage::HistoryReader(data.path() / "history.db").List().size(),
          kFaulty);
    }
  }

  void TearDown() override {
    for (int i = 0; i < kRanks && HasFailure(); ++i) {
      monitors_[i]->Signal(SIGCONT);
      monitors_[i]->Signal(SIGTERM);
      monitors_[i]->AwaitExit();
      std::printf("monitor %d:\n%s\n", i + 1, monitors_[i]->errors().c_str());
    }
  }

  const idl::TestDomain domain_;
  storage::TemporaryDirectory data_[kRanks];
  PairPlant plant_;
  std::unique_ptr<ChildProcess> monitors_[kRanks];
};

TEST_F(PairTest, OneOfTwoPublishesAndTheOtherTakesOverWhenItIsKilled) {
  BeginEpisodes();
  for (int round = 0; round < KillRounds(); ++round) {
    const int leader = Leader();
    const auto now = Clock::now();
    monitors_[leader]->Signal(SIGKILL);
    ExpectTakeOver(now);
    // It may have reached the other monitor and nobody else.
    EXPECT_TRUE(Await([&] {
      return plant_.Repeated(now - milliseconds(150)) > kValves / 2;
    }));
    Start(leader);
  }
  Leader();
  ExpectWhole();
}

TEST_F(PairTest, ALeaderThatHangsIsReplacedAndSaysNothingWhenItGoesOn) {
  BeginEpisodes();
  for (int round = 0; round < KillRounds(); ++round) {
    const int leader = Leader();
    const auto now = Clock::now();
    monitors_[leader]->Signal(SIGSTOP);
    ExpectTakeOver(now);
    monitors_[leader]->Signal(SIGCONT);
    EXPECT_NE(Leader(), leader);
  }
  ExpectWhole();
}

// Whichever of the two an operator uses, and though the other one be away.
TEST_F(PairTest, WhatOperatorsDoReachesBoth) {
  BeginEpisodes();
  const auto history = [&](int i) { return data_[i].path() / "history.db"; };
  const int leader = Leader();
  const std::string id =
      storage::HistoryReader(history(leader)).List().front().episode_id;
  storage::HistoryEditor(history(leader))
      .Acknowledge(id, {"anna", "seen", "test", storage::UtcNow()});
  storage::HistoryEditor(history(1 - leader))
      .Label(id, "true", {"ben", "", "test", storage::UtcNow()});
  const auto shown = [&](int i) {
    const storage::Episode episode =
        storage::HistoryReader(history(i)).Show(id);
    return episode.acked_by.value_or("") + " " + episode.label.value_or("");
  };
  EXPECT_TRUE(Await([&] {
    return shown(0) == "anna true" && shown(1) == "anna true";
  })) << shown(0)
      << ", " << shown(1);

  monitors_[leader]->Signal(SIGTERM);
  ASSERT_EQ(monitors_[leader]->AwaitExit(), 0);
  storage::HistoryEditor(history(1 - leader))
      .Shelve("V0", std::nullopt, storage::UtcNow() + 3'600'000'000'000,
              {"carl", "", "test", storage::UtcNow()});
  Start(leader);
  EXPECT_TRUE(Await([&] {
    return storage::HistoryReader(history(leader)).Shelves().size() == 1;
  }));
}

// An episode that begins while one of the two is away is one episode in both.
TEST_F(PairTest, IsUpgradedOneAfterTheOtherWithoutAMissingEpisode) {
  for (int i = 0; i < kRanks; ++i) {
    const int leader = Leader();
    const auto now = Clock::now();
    monitors_[leader]->Signal(SIGTERM);
    ExpectTakeOver(now);
    ASSERT_EQ(monitors_[leader]->AwaitExit(), 0);
    EXPECT_LT(plant_.Repeated(now - milliseconds(150)), kValves / 2);
    if (i == 0) {
      plant_.CountFromNow();
      plant_.SetFaulty(true);
      ASSERT_TRUE(Await([this] { return plant_.Isolated() == kFaulty; }));
    }
    Start(leader);
  }
  Leader();
  ExpectWhole();
}

// Monitors of a pair that notify of events, and of causes that all valves
// share.
class PairHookTest : public testing::Test {
 protected:
  static constexpr int kHookValves = 3;

  PairHookTest() {
    for (const storage::TemporaryDirectory& data : data_) {
      StorePairModels(data.path());
      std::ofstream(data.path() / "groups.toml")
          << "[[group]]\nname = 'all'\nvalves = ['V*']\nfaults = ['f7']\n"
             "min_valves = 2\n";
    }
  }

  std::unique_ptr<ChildProcess> Start(int i) const {
    return std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--data", data_[i].path().string(), "--domain",
        std::to_string(domain_.id()), "run", "--pair", "test", "--rank",
        std::to_string(i + 1), "--on-event",
        "dd status=none oflag=append conv=notrunc of=" + Notes().string()});
  }
  static void Stop(ChildProcess& monitor) {
    monitor.Signal(SIGTERM);
    EXPECT_EQ(monitor.AwaitExit(), 0) << monitor.errors();
  }
  // How many notifications of this kind came, of both monitors.
  int Count(const std::string& kind) const {
    std::ifstream file(Notes());
    int count = 0;
    for (std::string line; std::getline(file, line);) {
      count += line.find('"' + kind + '"') != std::string::npos ? 1 : 0;
    }
    return count;
  }
  std::filesystem::path Notes() const { return data_[0].path() / "notes"; }

  const idl::TestDomain domain_;
  const storage::TemporaryDirectory data_[2];
  PairPlant plant_{domain_.Options(), kHookValves, kHookValves,
                   milliseconds(20)};
};

// The bus gets once more what may not have been heard, the hook does not.
TEST_F(PairHookTest, AMonitorThatWasKilledNotifiesOfNoEventTwice) {
  auto monitor = Start(0);
  ASSERT_TRUE(Await([&] { return plant_.Leaders().size() == 1; }));
  plant_.SetFaulty(true);
  ASSERT_TRUE(Await([&] { return Count("DETECTED") == kHookValves; }))
      << monitor->errors();
  monitor->Signal(SIGKILL);
  ASSERT_TRUE(monitor->AwaitExit());

  monitor = Start(0);
  ASSERT_TRUE(Await([&] { return plant_.Count().repeats >= kHookValves; }))
      << monitor->errors();
  Stop(*monitor);
  EXPECT_EQ(Count("DETECTED"), kHookValves);
}

TEST_F(PairHookTest, OnlyTheLeaderNotifiesOfACommonCause) {
  if (!FDI_PLANNER) {
    GTEST_SKIP() << "the build has no planner";
  }
  const auto first = Start(0);
  const auto second = Start(1);
  ASSERT_TRUE(Await([&] { return plant_.Settled(); }));
  plant_.SetFaulty(true);
  for (ChildProcess* monitor : {first.get(), second.get()}) {
    ASSERT_TRUE(monitor->AwaitLine("common_cause kind=OPENED"))
        << monitor->errors();
  }
  Stop(*first);
  Stop(*second);
  EXPECT_EQ(Count("COMMON_CAUSE_OPENED"), 1);
}

}  // namespace
}  // namespace fdi::monitor
