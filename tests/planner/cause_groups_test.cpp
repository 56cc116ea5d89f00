#include "planner/live/cause_groups.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "monitor/service/history_store.h"
#include "planner/live/cause_watch.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::planner {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

using testing::HasSubstr;
using Kind = storage::CauseChange::Kind;

constexpr std::int64_t kStart = 1'700'000'000 * kSecond;

class CauseGroupsTest : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& text) {
    std::ofstream(directory_.path() / "groups.toml") << text;
    return directory_.path() / "groups.toml";
  }
  std::string Refusal(const std::string& text) {
    try {
      ReadCauseGroups(Write(text));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  }

  // As a new session of the monitor.
  void Open() {
    store_.reset();
    store_.emplace(
        directory_.path() / "history.db",
        [] { return kStart + 1000 * kSecond; },
        [](LogLevel, std::string_view) {});
    store_->BeginSession("test", "");
  }
  // As much as the watch of a session reads until its end.
  void Watch() {
    CauseWatch watch(
        directory_.path() / "history.db",
        ReadCauseGroups(Write("[[group]]\nname = 'header'\n"
                              "valves = ['A-*']\nfaults = ['f7']\n"
                              "min_valves = 2\nwithin_s = 60\n")),
        [this](const storage::CauseChange& change) { told_.push_back(change); },
        [this](const std::function<void()>& step) {
          try {
            step();
          } catch (const std::exception& error) {
            failures_.emplace_back(error.what());
          }
        });
    watch.Start();
    watch.Stop();
  }
  FaultEvent Event(const std::string& valve, TransitionKind kind,
                   std::int64_t at_s) const {
    FaultEvent event;
    event.valve_id = valve;
    event.source_id = 1;
    event.episode_id = EpisodeId(valve, 1, kStart);
    event.transition.kind = kind;
    event.transition.stamp_ns = kStart + at_s * kSecond;
    event.transition.detection_stamp_ns = kStart;
    event.transition.faults = kind == TransitionKind::kDetected ? 0 : 2;  // f7
    event.models = models_;
    event.model_set = "linear";
    event.model_version = 1;
    return event;
  }
  void Record(const std::string& valve, TransitionKind kind,
              std::int64_t at_s) {
    store_->CommitBatch([&] { store_->Record(Event(valve, kind, at_s)); });
  }

  storage::TemporaryDirectory directory_;
  std::shared_ptr<const ModelSet> models_{monitor::SharedLinearModels()};
  std::optional<monitor::HistoryStore> store_;
  std::vector<storage::CauseChange> told_;
  std::vector<std::string> failures_;
};

TEST_F(CauseGroupsTest, GroupsAreReadWithTheirDefaults) {
  const auto groups = ReadCauseGroups(
      Write("[[group]]\nname = 'west'\nvalves = ['FV-1*', 'LV-2']\n"));
  ASSERT_EQ(groups.size(), 1u);
  EXPECT_EQ(groups[0].faults, (std::vector<std::string>{"f16", "f17"}));
  EXPECT_EQ(groups[0].min_valves, 3);
  EXPECT_EQ(groups[0].within_ns, 300 * kSecond);
  EXPECT_TRUE(groups[0].Has("FV-12"));
  EXPECT_FALSE(groups[0].Has("LV-21"));
}

TEST_F(CauseGroupsTest, WhatCannotBeIsRefused) {
  EXPECT_THAT(Refusal("[[group]]\nvalves = ['a']"), HasSubstr("name"));
  EXPECT_THAT(Refusal("[[group]]\nname = 'w'"), HasSubstr("valves"));
  EXPECT_THAT(Refusal("[[group]]\nname = 'w'\nvalves = ['a']\nwithins = 3"),
              HasSubstr("did you mean"));
  EXPECT_THAT(Refusal("[[group]]\nname = 'w'\nvalves = ['a']\nfaults=['f99']"),
              HasSubstr("f99"));
  EXPECT_THAT(Refusal("[[group]]\nname = 'w'\nvalves = ['a']\nmin_valves = 1"),
              HasSubstr("2..100000"));
  EXPECT_THAT(Refusal("[[group]]\nname = 'w'\nvalves = ['a']\n"
                      "[[group]]\nname = 'w'\nvalves = ['b']"),
              HasSubstr("two groups"));
}

TEST_F(CauseGroupsTest, CauseIsToldOnceItIsStoredAndOverARestart) {
  Open();
  for (const char* valve : {"A-1", "A-2"}) {
    Record(valve, TransitionKind::kDetected, 0);
  }
  Record("A-1", TransitionKind::kIsolated, 10);
  Watch();
  EXPECT_TRUE(told_.empty());
  Open();

  Record("A-2", TransitionKind::kIsolated, 20);
  Watch();
  ASSERT_EQ(told_.size(), 1u);
  EXPECT_EQ(told_[0].kind, Kind::kOpened);
  const report::Json json = CauseJson(told_[0]);
  EXPECT_EQ(json["kind"], "COMMON_CAUSE_OPENED");
  EXPECT_EQ(json["valves"], 2);
  Watch();  // Reads the same events again.
  EXPECT_EQ(told_.size(), 1u);

  Record("A-1", TransitionKind::kClosed, 90);
  Open();
  Record("A-2", TransitionKind::kClosed, 95);
  Watch();
  ASSERT_EQ(told_.size(), 2u);
  EXPECT_EQ(told_[1].kind, Kind::kEnded);
  EXPECT_EQ(told_[1].cause.ended_ns, kStart + 95 * kSecond);
  EXPECT_TRUE(failures_.empty());
}

// A cause that cannot be stored costs no event.
TEST_F(CauseGroupsTest, ACauseThatCannotBeStoredIsAFailureOfItsOwn) {
  Open();
  {
    storage::Database file(directory_.path() / "history.db",
                           storage::HistorySchema(),
                           storage::Access::kOccasionalWriter);
    storage::Transaction transaction(file);
    file.Run(
        "CREATE TRIGGER no_cause BEFORE INSERT ON common_cause "
        "BEGIN SELECT RAISE(ABORT, 'no cause'); END");
    transaction.Commit();
  }
  for (const char* valve : {"A-1", "A-2"}) {
    Record(valve, TransitionKind::kDetected, 0);
    Record(valve, TransitionKind::kIsolated, 10);
  }
  Watch();

  EXPECT_TRUE(told_.empty());
  ASSERT_FALSE(failures_.empty());
  EXPECT_THAT(failures_[0], HasSubstr("no cause"));
  EXPECT_EQ(store_->OpenEpisodes().size(), 2u);
  EXPECT_EQ(store_->UnsentEvents().size(), 4u);
}

}  // namespace
}  // namespace fdi::planner
