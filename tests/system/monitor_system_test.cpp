// The built fdi-monitor as a process of its own, over DDS on loopback; this
// process publishes the samples and reads bus and databases.

#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time_text.h"
#include "storage/history/health.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/runs/runs.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

class MonitorSystemTest : public MonitorFixture {
 protected:
  storage::HistoryReader History() const {
    return storage::HistoryReader(data_ / "history.db");
  }
};

TEST_F(MonitorSystemTest, AFaultOnTheBusIsOnTheBusAndInTheHistory) {
  StoreModels(directory_.path(), LinearModels());
  const auto monitor = StartMonitor({"--model-set", "linear"});

  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(AwaitVectors(80));
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  EXPECT_EQ(vectors_.size(), 80U);
  EXPECT_TRUE(faults_.back().persisted);
  storage::HistoryReader history = History();
  const std::vector<storage::Episode> episodes = history.List();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].fault, "f7");
  EXPECT_EQ(episodes[0].model_set, "linear@1");
  EXPECT_EQ(episodes[0].detected_ns, PlantSample(50).stamp_ns);
  EXPECT_EQ(episodes[0].end_reason, "stream_ended");
  EXPECT_EQ(history.Trace(episodes[0].id).size(), 80U);
  EXPECT_TRUE(history.Sessions().at(0).clean);
}

// Three valves that show four times a limit in every fifth of their hours.
void StoreCommonHours(const std::filesystem::path& history,
                      std::uint64_t model_hash) {
  std::vector<HealthHour> hours;
  const std::int64_t newest = NowNs() / 3'600'000'000'000;
  for (const char* valve : {"V1", "V2", "V3"}) {
    for (int i = 0; i < 300; ++i) {
      HealthHour& hour = hours.emplace_back();
      hour.valve_id = valve;
      hour.hour = newest - 300 + i;
      hour.model_hash = model_hash;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.share = std::llround(3680.0 - 200.0 * std::log((i + 0.5) / 300.0));
    }
  }
  storage::Database database(history, storage::HistorySchema(),
                             storage::Access::kWriter);
  storage::Transaction transaction(database);
  storage::StoreHealth(database, hours);
  transaction.Commit();
}

TEST_F(MonitorSystemTest, WhatIsCommonIsANoticeUntilItIsRare) {
  const ModelSet models =
      storage::ModelStore(data_ / "models.db",
                          storage::Access::kOccasionalWriter)
          .Save(LinearModels(), storage::Activation::kAlways);
  StoreCommonHours(data_ / "history.db", models.content_hash);
  std::ofstream(data_ / "hook") << "#!/bin/sh\ncat >>" << data_ / "told";
  std::filesystem::permissions(data_ / "hook",
                               std::filesystem::perms::owner_all);
  const auto monitor =
      StartMonitor({"--model-set", "linear", "--alarm-budget", "1/year",
                    "--on-event", (data_ / "hook").string()});
  EXPECT_THAT(monitor->errors(), testing::HasSubstr("alarm_budget"));
  const auto state = [this] {
    const std::vector<storage::Episode> episodes = History().List();
    return episodes.empty() ? "" : (episodes[0].notice ? "notice" : "alarm");
  };

  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitVectors(80));
  ASSERT_TRUE(Await([&] { return state() == std::string("notice"); }));
  EXPECT_TRUE(faults_.empty());

  Publish(80, 110, 45.0);  // Nine times the limit.
  ASSERT_TRUE(Await([this] { return !faults_.empty(); }));
  ASSERT_TRUE(Await([&] { return state() == std::string("alarm"); }));
  samples_->Dispose({"V1", {}});
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed));
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  std::vector<std::string> kinds;
  for (const storage::HistoryEntry& event :
       History().Events(History().List().at(0).id)) {
    kinds.push_back(event.kind);
  }
  EXPECT_THAT(kinds, testing::Contains("RAISED"));
  std::ifstream file(data_ / "told");
  const std::string told(std::istreambuf_iterator<char>(file), {});
  EXPECT_THAT(told, testing::HasSubstr("RAISED")) << monitor->errors();
  EXPECT_THAT(told, testing::Not(testing::HasSubstr("\"DETECTED\"")));
}

TEST_F(MonitorSystemTest, WithoutModelsItSaysWhatIsJudged) {
  for (const auto& [option, judged] :
       {std::pair<std::vector<std::string>, const char*>{{}, "loops"},
        {{"--no-loop-audit"}, "nothing"}}) {
    const auto monitor = StartMonitor(option);
    EXPECT_THAT(
        monitor->errors(),
        testing::HasSubstr(std::string("no_model_set judged=") + judged));
    monitor->Signal(SIGTERM);
    EXPECT_EQ(monitor->AwaitExit(), 0);
  }
}

TEST_F(MonitorSystemTest, KilledInAnEpisodeItGoesOnWithItAndNotesTheOutage) {
  StoreModels(directory_.path(), LinearModels());
  auto monitor = StartMonitor();
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  monitor->Signal(SIGKILL);
  ASSERT_EQ(monitor->AwaitExit(), 128 + SIGKILL);
  ASSERT_TRUE(Await([this] {
    return decisions_->status().matched == 0 && samples_->matched() == 0;
  }));

  faults_.clear();
  monitor = StartMonitor();
  Publish(100, 140, kF7Offset);
  Publish(140, 170);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
  monitor->Signal(SIGINT);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  storage::HistoryReader history = History();
  const std::vector<storage::Episode> episodes = history.List();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].end_reason, "cleared");
  EXPECT_EQ(episodes[0].fault, "f7");
  std::vector<std::string> kinds;
  for (const storage::HistoryEntry& event : history.Events(episodes[0].id)) {
    kinds.push_back(event.kind);
  }
  EXPECT_THAT(kinds, testing::ElementsAre("DETECTED", "ISOLATED", "RESUMED",
                                          "CLEARED", "CLOSED"));
  bool outage_of_the_valve = false;
  for (const DataGap& gap : history.Gaps()) {
    outage_of_the_valve =
        outage_of_the_valve ||
        (gap.valve_id == "V1" && gap.reason == "monitor_down" &&
         gap.to_ns == PlantSample(100).stamp_ns);
  }
  EXPECT_TRUE(outage_of_the_valve);
  const std::vector<storage::MonitorSession> sessions = history.Sessions();
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_FALSE(sessions[0].clean);
  EXPECT_TRUE(sessions[1].clean);
}

TEST_F(MonitorSystemTest, KilledInAnEpisodeThatEndedMeanwhileItClosesUnknown) {
  StoreModels(directory_.path(), LinearModels());
  auto monitor = StartMonitor();
  Publish(0, 50);
  Publish(50, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  monitor->Signal(SIGKILL);
  ASSERT_EQ(monitor->AwaitExit(), 128 + SIGKILL);
  ASSERT_TRUE(Await([this] {
    return decisions_->status().matched == 0 && samples_->matched() == 0;
  }));

  faults_.clear();
  monitor = StartMonitor();
  Publish(100, 165);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kClosed)) << monitor->errors();
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0);

  EXPECT_EQ(faults_.back().transition.reason, EndReason::kUnknown);
  storage::HistoryReader history = History();
  ASSERT_EQ(history.List().size(), 1U);
  EXPECT_EQ(history.List()[0].end_reason, "unknown");
}

TEST_F(MonitorSystemTest, AHundredValvesLoseNothing) {
  constexpr std::uint64_t kSamples = 200;
  constexpr std::size_t kValves = 100;
  StoreModels(directory_.path(), LinearModels());
  const auto monitor = StartMonitor({"--record=lossless"});

  for (std::uint64_t k = 0; k < kSamples; ++k) {
    for (std::size_t v = 0; v < kValves; ++v) {
      Publish(PlantSample(k), "V" + std::to_string(v));
    }
    TakeVectors(milliseconds(0));
  }
  ASSERT_TRUE(AwaitVectors(kSamples * kValves)) << vectors_.size();
  ASSERT_TRUE(Await([this] {
    return counters_["recorded"] == kSamples * kValves - kValves ||
           counters_["recorded"] == kSamples * kValves;
  })) << counters_["recorded"];
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0) << monitor->errors();

  EXPECT_EQ(counters_["received"], kSamples * kValves);
  EXPECT_EQ(counters_["diagnosed"], kSamples * kValves);
  EXPECT_EQ(counters_["decisions"], kSamples * kValves);
  EXPECT_EQ(counters_["record_dropped"], 0U);
  EXPECT_EQ(vectors_.size(), kSamples * kValves);
  storage::RunStore runs(directory_.path() / "runs.db");
  std::int64_t recorded = 0;
  for (const storage::RunInfo& run : runs.List()) {
    recorded += run.samples;
    EXPECT_EQ(run.run.period_s, 1.0);
    EXPECT_EQ(run.state, storage::RunState::kComplete);
  }
  EXPECT_EQ(recorded, static_cast<std::int64_t>(kSamples * kValves));
}

TEST_F(MonitorSystemTest, BadSamplesAreCountedAndTheServiceGoesOn) {
  StoreModels(directory_.path(), LinearModels());
  const auto monitor = StartMonitor();
  Publish(0, 40);
  Publish(BadSample(40));
  Sample far = PlantSample(41);
  far.Set(Signal::kX, 1e9);
  Publish(far);
  Sample bad = PlantSample(42);
  bad.quality[Index(Signal::kCv)] = SignalQuality::kBad;
  Publish(bad);
  Publish(PlantSample(42));
  Publish(PlantSample(7));
  for (std::uint64_t k = 0; k < 10; ++k) {  // Every 5 s instead of every 1 s.
    Sample slow = PlantSample(5 * k, 0.0, 2);
    slow.seq = k;
    Publish(slow, "slow");
  }
  Publish(43, 80);
  Publish(80, 110, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0);
  ASSERT_TRUE(Await([this] { return counters_["received"] == 122; }));

  EXPECT_EQ(counters_["not_finite"], 1U);
  EXPECT_EQ(counters_["range"], 1U);
  EXPECT_EQ(counters_["bad_quality"], 1U);
  EXPECT_EQ(counters_["repeat"], 1U);
  EXPECT_EQ(counters_["late"], 1U);
  EXPECT_GT(counters_["period"], 5U);
  EXPECT_THAT(monitor->errors(), testing::HasSubstr("id=M102"));
  EXPECT_THAT(monitor->errors(), testing::HasSubstr("id=M105"));
}

TEST_F(MonitorSystemTest, AnActivatedModelSetAnswersFromTheNextSampleOn) {
  StoreModels(directory_.path(), LinearModels());
  const auto monitor = StartMonitor();
  Publish(0, 40);
  ASSERT_TRUE(AwaitVectors(40)) << monitor->errors();

  ModelSet next = LinearModels();
  next.decision.isolation_samples = 7;
  StoreModels(directory_.path(), next);
  ASSERT_TRUE(monitor->AwaitLine("valves_swapped=1")) << monitor->errors();
  Publish(40, 80);
  ASSERT_TRUE(AwaitVectors(80));

  for (std::size_t k = 0; k < 80; ++k) {
    EXPECT_EQ(vectors_[k].verdict.seq, k);
    EXPECT_EQ(vectors_[k].model_hash == vectors_[0].model_hash, k < 40) << k;
  }
  EXPECT_EQ(vectors_[40].verdict.quality, Quality::kSettling);
}

TEST_F(MonitorSystemTest, ASecondMonitorOnTheSameHistoryIsRefused) {
  const auto first = StartMonitor();
  ChildProcess second(Command({}));

  EXPECT_EQ(second.AwaitExit(), 3);
  EXPECT_THAT(second.errors(),
              testing::HasSubstr(std::to_string(first->pid())));
}

TEST_F(MonitorSystemTest, AModelSetThatIsNotThereEndsWithFive) {
  ChildProcess monitor(Command({"--model-set", "nowhere"}));

  EXPECT_EQ(monitor.AwaitExit(), 5);
  EXPECT_THAT(monitor.errors(), testing::HasSubstr("nowhere"));
}

TEST_F(MonitorSystemTest, ADamagedModelSetEndsWithThree) {
  const std::filesystem::path path =
      StoreModels(directory_.path(), LinearModels());
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  const std::size_t blob = bytes.find("FDIM");
  ASSERT_NE(blob, std::string::npos);
  file.clear();
  file.seekp(static_cast<std::streamoff>(blob + 40));
  file.put(static_cast<char>(bytes[blob + 40] ^ 0x55));
  file.close();

  ChildProcess monitor(Command({"--model-set", "linear"}));

  EXPECT_EQ(monitor.AwaitExit(), 3) << monitor.errors();
}

TEST_F(MonitorSystemTest, AHistoryOfANewerVersionEndsWithThree) {
  {
    const auto monitor = StartMonitor();
    monitor->Signal(SIGTERM);
    ASSERT_EQ(monitor->AwaitExit(), 0);
  }
  // user_version stands at offset 60 of the header, big endian.
  std::fstream file(directory_.path() / "history.db",
                    std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(63);
  file.put(99);
  file.close();

  ChildProcess monitor(Command({}));

  EXPECT_EQ(monitor.AwaitExit(), 3) << monitor.errors();
  EXPECT_THAT(monitor.errors(), testing::HasSubstr("99"));
}

}  // namespace
}  // namespace fdi::monitor
