#include <gmock/gmock.h>

#include "console/alarm_book.h"
#include "console/model_facts.h"
#include "report/shared_files.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/history_fixture.h"

namespace fdi::console {
namespace {

class AlarmBookTest : public storage::HistoryFixture {
 protected:
  void Begin(const std::string& valve) {
    writer_.Record(
        Event(TransitionKind::kDetected, 0, 0, 0.3, EndReason::kNone, valve),
        kDetected);
  }
  void End(const std::string& valve) {
    writer_.Record(
        Event(TransitionKind::kClosed, 60, 0, 0.1, EndReason::kCleared, valve),
        kDetected);
  }
  std::string IdOf(const std::string& valve) const {
    return storage::EpisodeIdText(Id(valve));
  }

  storage::HistoryWriter writer_{path_};
  report::FaultTexts texts_{report::SharedFile("faults.toml")};
  AlarmBook book_{
      [this] { return std::make_unique<storage::HistoryReader>(path_); },
      texts_};
};

TEST_F(AlarmBookTest, TellsWhatChangesFromTheFirstLookOn) {
  Begin("OLD");
  EXPECT_TRUE(book_.Refresh(kDetected).empty());
  Begin("NEW");
  const std::vector<Json> news = book_.Refresh(kDetected);

  ASSERT_EQ(news.size(), 1U);
  EXPECT_EQ(news[0]["valve"], "NEW");
  EXPECT_EQ(news[0]["isa"], "UNACK");
  EXPECT_EQ(news[0]["name"], "Fault without a name yet");
  EXPECT_TRUE(book_.Refresh(kDetected).empty());
  const auto valves = book_.ByValve();
  EXPECT_EQ(valves->at("OLD").since_ns, kDetected);
  EXPECT_EQ(valves->at("NEW").episode, IdOf("NEW"));
  EXPECT_TRUE(valves->at("NEW").unacked);
}

TEST_F(AlarmBookTest, TellsWhatAnotherProgramDidAndWhatIsOffTheList) {
  Begin("V");
  book_.Refresh(kDetected);
  storage::HistoryEditor(path_).Acknowledge(IdOf("V"), By("anna", kDetected));
  const std::vector<Json> acked = book_.Refresh(kDetected);
  End("V");
  const std::vector<Json> ended = book_.Refresh(kDetected);

  ASSERT_EQ(acked.size(), 1U);
  EXPECT_EQ(acked[0]["isa"], "ACKED");
  ASSERT_EQ(ended.size(), 1U);
  EXPECT_EQ(ended[0]["isa"], "NORMAL");
  EXPECT_EQ(ended[0]["state"], "CLOSED");
  EXPECT_TRUE(book_.ByValve()->empty());
}

// As PostgreSQL may be: what happened meanwhile is told when it is back.
TEST_F(AlarmBookTest, TellsSinceWhenTheHistoryIsAway) {
  bool away = true;
  AlarmBook book(
      [&]() -> std::unique_ptr<storage::History> {
        if (away) {
          throw storage::HistoryAwayError("PostgreSQL: Connection refused");
        }
        return std::make_unique<storage::HistoryReader>(path_);
      },
      texts_);
  EXPECT_THROW(book.Refresh(kDetected), storage::HistoryAwayError);
  EXPECT_THROW(book.Refresh(kDetected + kSecond), storage::HistoryAwayError);
  ASSERT_TRUE(book.away());
  EXPECT_EQ(book.away()->since_ns, kDetected);
  EXPECT_EQ(book.away()->reason, "PostgreSQL: Connection refused");

  away = false;
  Begin("V");
  EXPECT_TRUE(book.Refresh(kDetected).empty()) << "the first one";
  EXPECT_FALSE(book.away());
  EXPECT_EQ(book.Stored().rows.size(), 1U);
  EXPECT_EQ(book.Stored().note, "");
}

// Who asks for the alarms does not wait for a database that is locked.
TEST_F(AlarmBookTest, HasTheAlarmsOfTheLastAnswer) {
  Begin("V");
  bool away = false;
  AlarmBook book(
      [&]() -> std::unique_ptr<storage::History> {
        if (away) {
          throw storage::HistoryAwayError("PostgreSQL: lock timeout");
        }
        return std::make_unique<storage::HistoryReader>(path_);
      },
      texts_);
  EXPECT_TRUE(book.Stored().rows.empty());
  book.Refresh(kDetected);
  away = true;
  std::filesystem::remove(path_);
  EXPECT_ANY_THROW(book.Refresh(kDetected));
  EXPECT_ANY_THROW(book.Refresh(kDetected));

  const AlarmBook::Rows stored = book.Stored();

  ASSERT_EQ(stored.rows.size(), 1U);
  EXPECT_EQ(stored.rows[0]["valve"], "V");
  EXPECT_EQ(stored.note,
            "as of the last answer of the history: PostgreSQL: lock timeout");
}

// As on the page of a plant: the history comes later, by shipping.
TEST_F(AlarmBookTest, WhatWasHeardIsAnAlarmUntilTheHistoryHasIt) {
  book_.Refresh(kDetected);
  const auto event = [this](TransitionKind kind, const std::string& valve) {
    return Event(kind, 0, 0, 0.3, EndReason::kNone, valve);
  };
  EXPECT_TRUE(book_.OnEvent(event(TransitionKind::kDetected, "V")));
  EXPECT_TRUE(book_.OnEvent(event(TransitionKind::kDetected, "W")));
  EXPECT_EQ(book_.UnstoredAlarms().size(), 2U);
  EXPECT_EQ(book_.ByValve()->at("V").episode, IdOf("V"));
  EXPECT_TRUE(book_.ByValve()->at("W").unacked);

  EXPECT_TRUE(book_.OnEvent(event(TransitionKind::kClosed, "W")));
  EXPECT_EQ(AlarmFor(*book_.ByValve(), "W"), ValveAlarm{});
  Begin("V");
  EXPECT_EQ(book_.Refresh(kDetected).size(), 1U);
  EXPECT_TRUE(book_.UnstoredAlarms().empty());
  EXPECT_FALSE(book_.OnEvent(event(TransitionKind::kIsolated, "V")));
}

TEST_F(AlarmBookTest, TheEndOfWhatWasHeardLeavesWhatTheHistoryHas) {
  const std::int64_t until_ns = kDetected + 600 * kSecond;
  storage::HistoryEditor(path_).Shelve("V", std::nullopt, until_ns,
                                       By("anna", kDetected));
  book_.Refresh(kDetected + kSecond);
  for (const auto kind : {TransitionKind::kDetected, TransitionKind::kClosed}) {
    book_.OnEvent(Event(kind, 0, 0, 0.3, EndReason::kNone, "V"));

    EXPECT_EQ(book_.ByValve()->at("V").shelved_until_ns, until_ns);
  }
  EXPECT_FALSE(book_.ByValve()->at("V").unacked);
}

TEST_F(AlarmBookTest, TellsWhenAShelfRunsOut) {
  Begin("V");
  const std::int64_t until_ns = kDetected + 600 * kSecond;
  storage::HistoryEditor(path_).Shelve("V", std::nullopt, until_ns,
                                       By("anna", kDetected));
  book_.Refresh(kDetected + kSecond);
  EXPECT_EQ(book_.ByValve()->at("V").shelved_until_ns, until_ns);
  EXPECT_TRUE(book_.Refresh(until_ns - 1).empty());
  const std::vector<Json> back = book_.Refresh(until_ns);

  ASSERT_EQ(back.size(), 1U);
  EXPECT_TRUE(back[0]["shelved"].is_null());
  EXPECT_EQ(back[0]["isa"], "UNACK");
  EXPECT_FALSE(book_.ByValve()->at("V").shelved_until_ns);
}

TEST_F(AlarmBookTest, TellsWhenAPlannedShelfBegins) {
  Begin("V");
  const std::int64_t from_ns = kDetected + 600 * kSecond;
  storage::HistoryEditor(path_).Shelve("V", std::nullopt, from_ns + kSecond,
                                       By("anna", kDetected), from_ns);
  book_.Refresh(kDetected + kSecond);
  EXPECT_FALSE(book_.ByValve()->at("V").shelved_until_ns);
  EXPECT_EQ(book_.ByValve()->at("V").shelf_planned_ns, from_ns);
  EXPECT_TRUE(book_.Refresh(from_ns - 1).empty());

  ASSERT_EQ(book_.Refresh(from_ns).size(), 1U);
  EXPECT_TRUE(book_.ByValve()->at("V").shelved_until_ns);
  EXPECT_FALSE(book_.ByValve()->at("V").shelf_planned_ns);
}

TEST_F(AlarmBookTest, AnAlarmIsActiveUntilItHasReturned) {
  Begin("V");
  book_.Refresh(kDetected);
  EXPECT_TRUE(book_.ByValve()->at("V").active);
  End("V");
  book_.Refresh(kDetected);
  EXPECT_FALSE(book_.ByValve()->at("V").active);
  EXPECT_TRUE(book_.ByValve()->at("V").unacked);
}

class StoredModelsTest : public testing::Test {
 protected:
  StoredModelsTest() {
    storage::ModelStore store(path_, storage::Access::kOccasionalWriter);
    const ModelSet saved = store.Save(monitor::LinearModels());
    episode_.model_set = "linear@1";
    episode_.model_hash = saved.content_hash;
    episode_.channels = {"X", "F"};
    episode_.faults = {"f1"};
    episode_.flow_unit = FlowUnit::kTPerHour;
  }

  storage::TemporaryDirectory directory_;
  std::filesystem::path path_{directory_.path() / "models.db"};
  storage::Episode episode_;
};

TEST_F(StoredModelsTest, GiveTheThresholdsThatHeld) {
  StoredModels models(path_);

  const auto facts = models.For(episode_);
  ASSERT_EQ(facts->channels.size(), 1U);
  EXPECT_EQ(facts->channels[0].low, -5.0);
  EXPECT_EQ(facts->isolation_threshold, 0.7);
  EXPECT_EQ(models.For(episode_), facts);
}

TEST_F(StoredModelsTest, OfAnotherContentTheEpisodeTellsTheNames) {
  StoredModels models(path_);
  models.For(episode_);
  episode_.model_hash ^= 1U;

  const auto facts = models.For(episode_);
  ASSERT_EQ(facts->channels.size(), 2U);
  EXPECT_EQ(facts->channels[1].unit, "t/h");
  EXPECT_TRUE(std::isnan(facts->channels[0].low));
  EXPECT_EQ(facts->faults, std::vector<std::string>{"f1"});
}

}  // namespace
}  // namespace fdi::console
