// Events that a file may meet while a service uses it.

#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "storage/database/data_directory.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "storage/runs/run_recorder.h"
#include "storage/runs/runs.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using std::chrono::steady_clock;

constexpr std::uintmax_t kMegabyte = 1'000'000;
constexpr std::uintmax_t kJournalLimit = 67'108'864;

class DatabaseStressTest : public testing::Test {
 protected:
  void Grow(Database& database, std::uintmax_t bytes) {
    std::vector<std::byte> block(kMegabyte);
    for (std::uintmax_t done = 0; done < bytes; done += block.size()) {
      std::fill(block.begin(), block.end(), std::byte{++content_});
      Transaction transaction(database);
      database.Run(
          "INSERT INTO accumulator (valve_id, source_id, model_hash, stamp_ns, "
          "bytes) VALUES ('v', 1, 1, 1, ?1) "
          "ON CONFLICT DO UPDATE SET bytes = ?1",
          block);
      transaction.Commit();
    }
  }

  unsigned char content_{0};
  TemporaryDirectory directory_;
  const DataDirectory data_{directory_.path()};
};

TEST_F(DatabaseStressTest, TheLogShrinksOnceAReaderThatPinnedItIsGone) {
  Database writer(data_.history(), HistorySchema(), Access::kWriter);
  Database reader(data_.history(), HistorySchema(), Access::kReader);
  {
    const Snapshot pinned(reader);
    reader.QueryInt64("SELECT count(*) FROM episode");
    Grow(writer, 80 * kMegabyte);
    EXPECT_GT(WalBytes(data_.history()), 75 * kMegabyte);
    EXPECT_EQ(WalBytes(data_.history()), writer.WalBytes());
    EXPECT_EQ(WalBytes(data_.runs()), 0U);
  }
  // The first commit folds the log in, the next one begins it anew.
  Grow(writer, 2 * kMegabyte);

  EXPECT_LE(WalBytes(data_.history()), kJournalLimit + 2 * kMegabyte);
  EXPECT_LE(writer.FileBytes(), 10 * kMegabyte);
}

TEST_F(DatabaseStressTest, ACheckpointDoesNotWaitForAReader) {
  Database writer(data_.history(), HistorySchema(), Access::kWriter);
  Database reader(data_.history(), HistorySchema(), Access::kReader);
  const Snapshot pinned(reader);
  reader.QueryInt64("SELECT count(*) FROM episode");
  Grow(writer, kMegabyte);
  const auto start = steady_clock::now();

  EXPECT_FALSE(writer.Checkpoint());
  EXPECT_LT(steady_clock::now() - start, std::chrono::seconds(1));
}

TEST_F(DatabaseStressTest, ACorruptPageIsAFindingOrARefusalAndStaysAsItIs) {
  {
    Database writer(data_.history(), HistorySchema(), Access::kWriter);
    Grow(writer, kMegabyte);
    ASSERT_TRUE(writer.Checkpoint());
  }
  // The root page of a table of the monitor.
  std::int64_t page = 0;
  {
    Database reader(data_.history(), HistorySchema(), Access::kReader);
    page = reader
               .QueryInt64(
                   "SELECT rootpage FROM sqlite_schema "
                   "WHERE name = 'monitor_session'")
               .value_or(0);
  }
  ASSERT_GT(page, 1);
  std::fstream file(data_.history(),
                    std::ios::in | std::ios::out | std::ios::binary);
  file.seekp((page - 1) * 4096);
  file << std::string(4096, '\x55');
  file.close();
  const auto bytes = std::filesystem::file_size(data_.history());

  EXPECT_THROW(
      {
        HistoryWriter writer(data_.history());
        writer.BeginSession(1, "test", "");
      },
      SqliteError);
  Database reader(data_.history(), HistorySchema(), Access::kReader);
  EXPECT_FALSE(reader.Check().empty());
  EXPECT_EQ(std::filesystem::file_size(data_.history()), bytes);
}

// Opens in a child process that is not root and may not write to `folder`.
// @returns 0 if that throws a DataError with both texts.
template <typename Open>
int OpenUnwritable(const std::filesystem::path& folder, Open open,
                   const std::string& file, const char* reason) {
  using std::filesystem::perms;
  std::filesystem::permissions(folder, perms::owner_read | perms::owner_exec |
                                           perms::others_read |
                                           perms::others_exec);
  const pid_t child = fork();
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    if (geteuid() == 0 && (setgroups(0, nullptr) != 0 || setgid(kNobody) != 0 ||
                           setuid(kNobody) != 0)) {
      _exit(2);
    }
    try {
      open();
    } catch (const DataError& error) {
      const std::string_view text = error.what();
      _exit(text.find(file) != text.npos && text.find(reason) != text.npos ? 0
                                                                           : 3);
    }
    _exit(1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  std::filesystem::permissions(folder, perms::owner_all);
  return status;
}

TEST_F(DatabaseStressTest, AFolderThatCannotBeWrittenIsRefusedByName) {
  EXPECT_EQ(OpenUnwritable(
                directory_.path(),
                [this] { const RunRecorder recorder(data_.runs()); },
                data_.runs().string(), "Permission denied"),
            0);
  EXPECT_FALSE(std::filesystem::exists(data_.runs()));
}

// SQLite's files beside the database go when the last user closes it.
TEST_F(DatabaseStressTest, AReaderWhoMayNotWriteIsToldWhatToDo) {
  { const HistoryWriter writer(data_.history()); }
  // As a kill leaves it: with what no reader may fold in.
  const std::string wal = data_.history().string() + "-wal";
  std::ofstream(wal) << "frames";
  for (const std::string& file : {data_.history().string(), wal}) {
    std::filesystem::permissions(file, std::filesystem::perms::others_read,
                                 std::filesystem::perm_options::add);
  }
  EXPECT_EQ(OpenUnwritable(
                directory_.path(),
                [this] {
                  const Database reader(data_.history(), HistorySchema(),
                                        Access::kReader);
                },
                data_.history().string(), "fdi-store backup"),
            0);
}

}  // namespace
}  // namespace fdi::storage
