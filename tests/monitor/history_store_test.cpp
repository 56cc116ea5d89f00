#include "monitor/service/history_store.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;

constexpr std::int64_t kStart = 1'700'000'000'000'000'000;

class HistoryStoreTest : public testing::Test {
 protected:
  HistoryStore Open() {
    return HistoryStore(
        path_, [this] { return now_ns_; },
        [this](LogLevel level, std::string_view line) {
          if (level == LogLevel::kError) {
            errors_.emplace_back(line);
          }
        });
  }
  static FaultEvent Detection(const std::string& valve) {
    FaultEvent event;
    event.valve_id = valve;
    event.episode_id = EpisodeId(valve, 0, kStart);
    event.transition.kind = TransitionKind::kDetected;
    event.transition.stamp_ns = kStart;
    event.transition.detection_stamp_ns = kStart;
    event.models = SharedLinearModels();
    return event;
  }
  void DamageIdOf(const std::string& valve) const {
    storage::Database file(path_, storage::HistorySchema(),
                           storage::Access::kOccasionalWriter);
    storage::Transaction transaction(file);
    file.Run("DROP TRIGGER episode_event_keeps");
    file.QueryInt64("PRAGMA defer_foreign_keys = ON");
    const std::string id = storage::EpisodeIdText(Detection(valve).episode_id);
    for (const char* table : {"episode", "episode_event"}) {
      file.Run("UPDATE " + std::string(table) +
                   " SET episode_id = 'not sixteen hex.' WHERE episode_id = ?",
               id);
    }
    transaction.Commit();
  }

  storage::TemporaryDirectory directory_;
  const std::filesystem::path path_ = directory_.path() / "history.db";
  std::int64_t now_ns_{kStart};
  std::vector<std::string> errors_;
};

TEST_F(HistoryStoreTest, ADamagedIdIsReportedAndTheOthersAreSent) {
  {
    HistoryStore store = Open();
    store.CommitBatch([&] {
      store.Record(Detection("A"));
      store.Record(Detection("B"));
    });
  }
  DamageIdOf("A");

  HistoryStore store = Open();
  const auto unsent = store.UnsentEvents();
  const auto open = store.OpenEpisodes();

  ASSERT_EQ(unsent.size(), 1U);
  EXPECT_EQ(unsent[0].valve_id, "B");
  ASSERT_EQ(open.size(), 1U);
  EXPECT_EQ(open[0].valve_id, "B");
  ASSERT_EQ(errors_.size(), 2U);
  EXPECT_THAT(errors_[0], HasSubstr("history_damaged"));
  EXPECT_THAT(errors_[0], HasSubstr("event_outbox, event 1"));
}

TEST_F(HistoryStoreTest, AnEventThatWasSentAgainIsNotSentOnceMore) {
  {
    HistoryStore store = Open();
    store.CommitBatch([&] { store.Record(Detection("A")); });
  }
  {
    HistoryStore store = Open();
    for (const FaultEvent& event : store.UnsentEvents()) {
      store.MarkSent(event);
    }
    store.Commit();
  }

  EXPECT_TRUE(Open().UnsentEvents().empty());
}

TEST_F(HistoryStoreTest, AnOutageEndsNoEarlierThanItBeginsIfTheClockIsSetBack) {
  Open().BeginSession("test", "");  // It ends without EndSession().
  now_ns_ -= 3'600'000'000'000;
  Open().BeginSession("test", "");

  const auto gaps = storage::HistoryReader(path_).Gaps();
  ASSERT_EQ(gaps.size(), 1U);
  EXPECT_EQ(gaps[0].from_ns, now_ns_);
  EXPECT_EQ(gaps[0].to_ns, now_ns_);
}

TEST_F(HistoryStoreTest, ARecordOfAnEpisodeThatHasEndedIsRefused) {
  HistoryStore store = Open();
  FaultEvent end = Detection("A");
  end.transition.kind = TransitionKind::kClosed;
  end.transition.stamp_ns = kStart + 10;
  FaultEvent late = Detection("A");
  late.transition.kind = TransitionKind::kReisolated;
  late.transition.stamp_ns = kStart + 20;
  store.CommitBatch([&] {
    EXPECT_TRUE(store.Record(Detection("A")));
    EXPECT_TRUE(store.Record(end));
    EXPECT_TRUE(store.Record(Detection("A")));  // It is there.
    EXPECT_FALSE(store.Record(late));
    FaultEvent unknown = end;
    unknown.episode_id = 42;
    unknown.models = nullptr;
    EXPECT_FALSE(store.Record(unknown));
  });
}

// A trigger stands for all that SQLite refuses of the values themselves.
TEST_F(HistoryStoreTest, ValuesThatAreRefusedAreToldFromAFileThatFails) {
  HistoryStore store = Open();
  const auto execute = [this](std::string_view sql) {
    storage::Database file(path_, storage::HistorySchema(),
                           storage::Access::kOccasionalWriter);
    storage::Transaction transaction(file);
    file.Run(sql);
    transaction.Commit();
  };
  execute(
      "CREATE TRIGGER no_a BEFORE INSERT ON episode WHEN NEW.valve_id = 'A' "
      "BEGIN SELECT RAISE(ABORT, 'not A'); END");
  execute(
      "CREATE TRIGGER no_gap BEFORE INSERT ON data_gap "
      "BEGIN SELECT RAISE(ABORT, 'no gap'); END");
  const auto record = [&store](const char* valve) {
    store.CommitBatch([&] { store.Record(Detection(valve)); });
  };

  EXPECT_THROW(record("A"), RecordError);
  EXPECT_NO_THROW(record("B"));
  store.AddGap({"B", kStart, kStart, "stream"});
  EXPECT_THROW(record("C"), RecordError);
  store.DropBuffered();
  EXPECT_NO_THROW(record("C"));
  execute("ALTER TABLE episode RENAME TO away");
  try {
    record("D");
    FAIL();
  } catch (const RecordError&) {
    FAIL() << "the file is broken, not the record";
  } catch (const storage::SqliteError&) {
  }
}

}  // namespace
}  // namespace fdi::monitor
