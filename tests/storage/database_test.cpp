#include "storage/database/database.h"

#include <fstream>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "storage/database/data_directory.h"
#include "storage/database/locks.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {
namespace {

using ::testing::HasSubstr;

constexpr std::string_view kFirst =
    "CREATE TABLE t (id INTEGER PRIMARY KEY, v REAL, s TEXT, b BLOB) STRICT;"
    "CREATE TABLE child (parent INTEGER NOT NULL REFERENCES t (id)) STRICT;";
constexpr std::string_view kSecondVersion =
    "ALTER TABLE t ADD COLUMN extra INTEGER;"
    "UPDATE t SET extra = id * 10;";

Schema SchemaOf(int version, std::int32_t id = 0x1234) {
  Schema schema{"test", id, Synchronous::kNormal, {kFirst, kSecondVersion}};
  schema.migrations.resize(static_cast<std::size_t>(version));
  return schema;
}

class DatabaseTest : public ::testing::Test {
 protected:
  std::string MessageOf(const Schema& schema, Access access) {
    try {
      const Database database(file_, schema, access);
    } catch (const DataError& error) {
      return error.what();
    }
    return "no DataError";
  }
  void Insert(Database& database, int id) {
    Transaction transaction(database);
    database.Run("INSERT INTO t (id) VALUES (?)", id);
    transaction.Commit();
  }

  TemporaryDirectory directory_;
  std::filesystem::path file_{directory_.path() / "test.db"};
};

// A program is killed while SQLite turns a new file into one with a log: the
// journal of that change is left, and a reader may not roll it back.
TEST_F(DatabaseTest,
       AJournalThatAKilledProgramLeftIsOneOfAFileThatWasOnlyBegun) {
  const std::filesystem::path begun = directory_.path() / "begun.db";
  {
    SQLite::Database raw(begun.string(),
                         SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    // Without a sync SQLite writes the head of the journal at once, so that the
    // journal counts as one of a change that was interrupted.
    raw.exec(
        "PRAGMA synchronous=OFF; CREATE TABLE x (y); BEGIN; DROP TABLE x;");
    for (const char* suffix : {"", "-journal"}) {
      std::filesystem::copy(begun.string() + suffix, file_.string() + suffix);
    }
  }
  EXPECT_THAT(MessageOf(SchemaOf(1), Access::kReader), HasSubstr("is empty"));
  EXPECT_THROW(Database(file_, SchemaOf(1), Access::kReader), OutdatedError);
}

// In SQLite's own, ! is a member of the set.
TEST_F(DatabaseTest, GlobIsTheOneOfTheMonitor) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  EXPECT_EQ(database.QueryInt64("SELECT 'b' GLOB '[!a]'"), 1);
  EXPECT_EQ(database.QueryInt64("SELECT 'a' GLOB '[!a]'"), 0);
  EXPECT_EQ(database.QueryInt64("SELECT 'a' GLOB '[^a]'"), 0);
  EXPECT_EQ(database.QueryInt64("SELECT 'FV-101' GLOB 'FV-1*'"), 1);
}

TEST_F(DatabaseTest, EveryTypeReadsBackAsItWasBound) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  const std::vector<std::byte> blob{std::byte{0}, std::byte{255}};
  {
    Transaction transaction(database);
    database.Run("INSERT INTO t VALUES (?, ?, ?, ?)", ~std::uint64_t{0}, 5e-324,
                 "text", std::span<const std::byte>(blob));
    database.Run("INSERT INTO t VALUES (?, ?, ?, ?)", 2, std::nullopt,
                 std::optional<std::string>(), std::span<const std::byte>());
    transaction.Commit();
  }

  Statement rows = database.Prepare("SELECT * FROM t ORDER BY id");
  ASSERT_TRUE(rows.Step());
  EXPECT_EQ(rows.Uint64(0), ~std::uint64_t{0});
  EXPECT_EQ(rows.Double(1), 5e-324);
  EXPECT_EQ(rows.Text(2), "text");
  EXPECT_EQ(rows.Blob(3), blob);
  ASSERT_TRUE(rows.Step());
  EXPECT_TRUE(rows.IsNull(1));
  EXPECT_EQ(rows.OptionalText(2), std::nullopt);
  EXPECT_FALSE(rows.IsNull(3));
  EXPECT_FALSE(rows.Step());
}

TEST_F(DatabaseTest, TransactionRollsBackUnlessCommitted) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  {
    Transaction transaction(database);
    database.Run("INSERT INTO t (id) VALUES (1)");
  }
  EXPECT_EQ(database.QueryInt64("SELECT count(*) FROM t"), 0);
}

TEST_F(DatabaseTest, WritingOutsideATransactionIsALogicError) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  EXPECT_THROW(database.Run("DELETE FROM t"), std::logic_error);
}

TEST_F(DatabaseTest, ReaderCannotWriteAndNeedsTheFile) {
  EXPECT_THAT(MessageOf(SchemaOf(1), Access::kReader),
              HasSubstr("No such file"));
  const Database writer(file_, SchemaOf(1), Access::kWriter);

  Database reader(file_, SchemaOf(1), Access::kReader);
  EXPECT_THROW(Transaction{reader}, std::logic_error);
  EXPECT_THROW(reader.Checkpoint(), std::logic_error);
}

TEST_F(DatabaseTest, ForeignKeysHoldAndStrictTablesRefuseText) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  Transaction transaction(database);
  EXPECT_THROW(database.Run("INSERT INTO child VALUES (7)"), SqliteError);
  EXPECT_THROW(database.Run("INSERT INTO t (v) VALUES ('x')"), SqliteError);
}

TEST_F(DatabaseTest, MigrationKeepsRowsAndLeavesTheOldFileBeside) {
  {
    Database old(file_, SchemaOf(1), Access::kWriter);
    Insert(old, 4);
  }
  EXPECT_THROW(Database(file_, SchemaOf(2), Access::kReader), OutdatedError);
  EXPECT_THAT(MessageOf(SchemaOf(2), Access::kReader),
              HasSubstr("fdi-store doctor"));

  Database migrated(file_, SchemaOf(2), Access::kOccasionalWriter);
  EXPECT_EQ(migrated.version(), 2);
  EXPECT_EQ(migrated.QueryInt64("SELECT extra FROM t"), 40);
  Database backup(file_.string() + ".v1.backup", SchemaOf(1), Access::kReader);
  EXPECT_EQ(backup.QueryInt64("SELECT id FROM t"), 4);
}

TEST_F(DatabaseTest, FailedMigrationLeavesTheOldVersion) {
  {
    Database old(file_, SchemaOf(1), Access::kWriter);
    Insert(old, 4);
  }
  Schema broken = SchemaOf(1);
  broken.migrations.push_back("DELETE FROM t; SELECT nothing FROM nowhere;");

  EXPECT_THROW(Database(file_, broken, Access::kWriter), SqliteError);
  EXPECT_FALSE(std::filesystem::exists(file_.string() + ".v1.backup"));
  Database after(file_, SchemaOf(1), Access::kWriter);
  EXPECT_EQ(after.QueryInt64("SELECT id FROM t"), 4);
}

TEST_F(DatabaseTest, AFullDiskIsNoNumber) {
  const SqliteError full(13, "database or disk is full in: COMMIT");
  EXPECT_THAT(full.what(), HasSubstr("the disk of the databases is full"));
  EXPECT_EQ(std::string(full.what()).find("13"), std::string::npos);
}

// The first script of a schema makes its baseline, whatever its number.
TEST_F(DatabaseTest, VersionsBeforeTheBaselineAreRefusedAndLeftAlone) {
  { const Database old(file_, SchemaOf(1), Access::kWriter); }
  Schema schema{
      "test", 0x1234,         Synchronous::kNormal, {kFirst, kSecondVersion},
      16,     "make it again"};
  for (const Access access :
       {Access::kWriter, Access::kOccasionalWriter, Access::kReader}) {
    const std::string message = MessageOf(schema, access);
    EXPECT_THAT(message, HasSubstr(file_.string() + ": version 1 was never"));
    EXPECT_THAT(message, HasSubstr("move it away and make it again"));
  }
  { const Database same(file_, SchemaOf(1), Access::kReader); }
  std::filesystem::remove(file_);
  EXPECT_EQ(Database(file_, schema, Access::kWriter).version(), 17);
  schema.migrations.push_back("ALTER TABLE t ADD COLUMN more INTEGER;");
  EXPECT_EQ(Database(file_, schema, Access::kWriter).version(), 18);
  EXPECT_TRUE(std::filesystem::exists(file_.string() + ".v17.backup"));
}

TEST_F(DatabaseTest, NewerVersionIsRefusedNamingFileAndBothVersions) {
  { const Database newer(file_, SchemaOf(2), Access::kWriter); }
  for (const Access access :
       {Access::kWriter, Access::kOccasionalWriter, Access::kReader}) {
    const std::string message = MessageOf(SchemaOf(1), access);
    EXPECT_THAT(message, HasSubstr(file_.string()));
    EXPECT_THAT(message, HasSubstr("version 2 is newer"));
    EXPECT_THAT(message, HasSubstr("up to 1"));
  }
}

TEST_F(DatabaseTest, AnotherKindOfFileIsRefused) {
  { const Database other(file_, SchemaOf(1, 0x77), Access::kWriter); }
  EXPECT_THAT(MessageOf(SchemaOf(1), Access::kWriter),
              HasSubstr("application_id 119"));
}

TEST_F(DatabaseTest, FileThatIsNoDatabaseIsRefusedAndLeftAlone) {
  const std::string text(5000, 'x');
  std::ofstream(file_) << text;

  EXPECT_THAT(MessageOf(SchemaOf(1), Access::kWriter),
              HasSubstr("file is not a database"));
  EXPECT_EQ(std::filesystem::file_size(file_), text.size());
}

TEST_F(DatabaseTest, UnreachablePathsAreNamedWithTheReason) {
  std::ofstream(file_) << "x";
  const std::filesystem::path below = file_ / "sub" / "runs.db";
  try {
    const Database database(below, SchemaOf(1), Access::kWriter);
    ADD_FAILURE();
  } catch (const DataError& error) {
    EXPECT_THAT(error.what(), HasSubstr(below.string()));
    EXPECT_THAT(error.what(), HasSubstr("Not a directory"));
  }
  EXPECT_THROW(EnsureExists({file_ / "data"}), DataError);
  file_ = directory_.path() / "missing" / "runs.db";
  EXPECT_THAT(MessageOf(SchemaOf(1), Access::kWriter),
              HasSubstr("missing: No such file"));
}

TEST_F(DatabaseTest, DataVersionTellsOfTheCommitsOfOthersOnly) {
  Database writer(file_, SchemaOf(1), Access::kWriter);
  Database reader(file_, SchemaOf(1), Access::kReader);
  const std::int64_t before = reader.DataVersion();
  EXPECT_EQ(reader.DataVersion(), before);

  Insert(writer, 1);
  EXPECT_NE(reader.DataVersion(), before);
}

TEST_F(DatabaseTest, CheckpointTruncatesTheLog) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  Insert(database, 1);
  EXPECT_GT(database.WalBytes(), 0U);

  EXPECT_TRUE(database.Checkpoint());
  EXPECT_EQ(database.WalBytes(), 0U);
  EXPECT_TRUE(database.Check().empty());
}

TEST_F(DatabaseTest, CheckFindsARowWithoutItsParent) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  database.Prepare("PRAGMA foreign_keys = OFF").Step();
  {
    Transaction transaction(database);
    database.Run("INSERT INTO child VALUES (7)");
    transaction.Commit();
  }
  EXPECT_THAT(database.Check(),
              ::testing::ElementsAre(HasSubstr("table child has no parent")));
}

// Others than ours, e.g. the shell of SQLite, do not know the gate.
TEST_F(DatabaseTest, ATransactionHoldsTheWriteLockFromItsBeginning) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  Database other(file_, SchemaOf(1), Access::kWriter);
  other.Prepare("PRAGMA busy_timeout = 0").Step();
  const Transaction transaction(database);

  other.Prepare("SAVEPOINT past_the_gate").Run();
  try {
    other.Run("INSERT INTO t (id) VALUES (1)");
    ADD_FAILURE();
  } catch (const SqliteError& error) {
    EXPECT_TRUE(error.IsBusy());
  }
}

TEST_F(DatabaseTest, TheGateLetsOneConnectionIn) {
  WriteGate first(file_);
  WriteGate second(file_);
  EXPECT_TRUE(first.Enter(std::chrono::milliseconds(0)));
  EXPECT_FALSE(second.Enter(std::chrono::milliseconds(0)));

  first.Leave();
  EXPECT_TRUE(second.Enter(std::chrono::milliseconds(0)));
}

TEST_F(DatabaseTest, TransactionsPassTheGate) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  WriteGate gate(file_);
  {
    const Transaction transaction(database);
    EXPECT_FALSE(gate.Enter(std::chrono::milliseconds(0)));
  }
  EXPECT_TRUE(gate.Enter(std::chrono::milliseconds(0)));
}

TEST_F(DatabaseTest, AReaderCanCopyTheFile) {
  Database writer(file_, SchemaOf(1), Access::kWriter);
  Insert(writer, 5);
  Database reader(file_, SchemaOf(1), Access::kReader);
  reader.BackupTo(directory_.path() / "copy.db");

  Database copy(directory_.path() / "copy.db", SchemaOf(1), Access::kReader);
  EXPECT_EQ(copy.QueryInt64("SELECT id FROM t"), 5);
  EXPECT_THROW(reader.BackupTo(directory_.path() / "copy.db"), DataError);
}

TEST_F(DatabaseTest, ADeletedFileTakesNoCommitAndIsMadeAnew) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  Insert(database, 1);
  EXPECT_FALSE(database.Refresh());
  for (const char* name : {"test.db", "test.db-wal", "test.db-shm"}) {
    std::filesystem::remove(directory_.path() / name);
  }

  try {
    Insert(database, 2);
    FAIL() << "stored into no file";
  } catch (const SqliteError& error) {
    EXPECT_THAT(error.what(), HasSubstr("was deleted or replaced"));
    EXPECT_FALSE(error.IsOfValues());
  }
  EXPECT_TRUE(database.Refresh());
  EXPECT_FALSE(database.Refresh());
  Insert(database, 3);

  Database reader(file_, SchemaOf(1), Access::kReader);
  EXPECT_EQ(reader.QueryInt64("SELECT sum(id) FROM t"), 3);
}

// Killed in the copy, and between the commit and the copy's name.
TEST_F(DatabaseTest, AKilledMigrationLeavesOneCopy) {
  { Database(file_, SchemaOf(1), Access::kWriter); }
  const std::string copy = file_.string() + ".v1.backup";
  std::ofstream(copy + ".unfinished") << "half of a copy";
  { Database(file_, SchemaOf(2), Access::kWriter); }
  EXPECT_FALSE(std::filesystem::exists(copy + ".unfinished"));
  EXPECT_NO_THROW(Database(copy, SchemaOf(1), Access::kReader));
  EXPECT_FALSE(std::filesystem::exists(file_.string() + ".v1-2.backup"));

  std::filesystem::rename(copy, copy + ".unfinished");
  { Database(file_, SchemaOf(2), Access::kWriter); }
  EXPECT_TRUE(std::filesystem::exists(copy));
  EXPECT_FALSE(std::filesystem::exists(copy + ".unfinished"));
}

// As with `mv backup.db test.db`: SQLite would take the WAL for the backup's.
TEST_F(DatabaseTest, AFileThatReplacesItIsReadWithoutTheOldWal) {
  const auto backup = directory_.path() / "backup.db";
  {
    Database database(backup, SchemaOf(1), Access::kWriter);
    Insert(database, 7);
  }
  Database database(file_, SchemaOf(1), Access::kWriter);
  Database reader(file_, SchemaOf(1), Access::kReader);
  Insert(database, 1);
  ASSERT_GT(database.WalBytes(), 0U);
  std::filesystem::rename(backup, file_);

  EXPECT_THROW(reader.Refresh(), DataError);
  EXPECT_TRUE(database.Refresh());
  Insert(database, 8);
  EXPECT_TRUE(reader.Refresh());

  for (Database* each : {&database, &reader}) {
    EXPECT_EQ(each->QueryInt64("SELECT sum(id) FROM t"), 15);
    EXPECT_TRUE(each->Check().empty());
  }
}

// "They are temporary files": the commits of each connection stay, also those
// of a program that is started in between.
TEST_F(DatabaseTest, ADeletedLogGetsItsNameBack) {
  {
    Database database(file_, SchemaOf(1), Access::kWriter);
    Database reader(file_, SchemaOf(1), Access::kReader);
    Insert(database, 1);
    for (const char* name : {"test.db-wal", "test.db-shm"}) {
      ASSERT_TRUE(std::filesystem::remove(directory_.path() / name));
    }
    {
      Database other(file_, SchemaOf(1), Access::kOccasionalWriter);
      Insert(other, 2);
    }
    EXPECT_EQ(reader.QueryInt64("SELECT count(*) FROM t"), 2);
    ASSERT_TRUE(std::filesystem::remove(directory_.path() / "test.db-wal"));
    Insert(database, 3);
    ASSERT_TRUE(std::filesystem::remove(directory_.path() / "test.db-shm"));
    EXPECT_FALSE(database.Refresh());
    EXPECT_FALSE(reader.Refresh());
    EXPECT_EQ(reader.QueryInt64("SELECT count(*) FROM t"), 3);
    ASSERT_TRUE(std::filesystem::remove(directory_.path() / "test.db-wal"));
  }
  const std::filesystem::directory_iterator files(directory_.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 2);  // And the gate.
  Database database(file_, SchemaOf(1), Access::kWriter);
  EXPECT_EQ(database.QueryInt64("SELECT sum(id) FROM t"), 6);
  EXPECT_TRUE(database.Check().empty());
}

// Somebody restores "all files" of a backup while the database is open.
TEST_F(DatabaseTest, ALogThatReplacesItIsSetAside) {
  Database database(file_, SchemaOf(1), Access::kWriter);
  Insert(database, 1);
  std::ofstream(directory_.path() / "old") << "another log";
  std::filesystem::rename(directory_.path() / "old",
                          directory_.path() / "test.db-wal");
  EXPECT_FALSE(database.Refresh());
  EXPECT_TRUE(
      std::filesystem::exists(directory_.path() / "test.db-wal.replaced"));
  Database other(file_, SchemaOf(1), Access::kOccasionalWriter);
  Insert(other, 2);
  EXPECT_EQ(database.QueryInt64("SELECT sum(id) FROM t"), 3);
}

// A process that was killed leaves second names that nobody locks.
TEST_F(DatabaseTest, TheLogOfAKilledProgramIsNotPutBack) {
  const pid_t child = fork();
  if (child == 0) {
    Database database(file_, SchemaOf(1), Access::kWriter);
    Insert(database, 1);
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  ASSERT_TRUE(std::filesystem::exists(directory_.path() / "test.db-wal"));
  { Database(file_, SchemaOf(1), Access::kWriter).Checkpoint(); }
  EXPECT_FALSE(std::filesystem::exists(directory_.path() / "test.db-wal"));
  Database database(file_, SchemaOf(1), Access::kWriter);
  EXPECT_EQ(database.QueryInt64("SELECT sum(id) FROM t"), 1);
  Insert(database, 2);
  EXPECT_EQ(database.QueryInt64("SELECT sum(id) FROM t"), 3);
}

// A backup is not in WAL mode.
TEST_F(DatabaseTest, ABackupTakesCommits) {
  const auto backup = directory_.path() / "backup.db";
  {
    Database database(file_, SchemaOf(1), Access::kWriter);
    Insert(database, 1);
    database.BackupTo(backup);
  }
  Database database(backup, SchemaOf(1), Access::kWriter);
  Insert(database, 2);
  EXPECT_EQ(database.QueryInt64("SELECT sum(id) FROM t"), 3);
}

// A member of the group that may read the folder, but not write to it: SQLite
// wants to make its shared memory there.
TEST_F(DatabaseTest, WhatNobodyHasOpenIsReadWithoutWriting) {
  using std::filesystem::perms;
  const auto folder = directory_.path() / "50%?#";
  std::filesystem::create_directory(folder);
  {
    Database database(folder / "test.db", SchemaOf(1), Access::kWriter);
    Insert(database, 7);
  }
  ASSERT_FALSE(std::filesystem::exists(folder / "test.db-wal"));
  const perms reading = perms::all & ~(perms::owner_write | perms::group_write |
                                       perms::others_write);
  std::filesystem::permissions(directory_.path(), reading);
  std::filesystem::permissions(folder, reading);

  const pid_t child = fork();
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    if (getuid() == 0 && setuid(kNobody) != 0) {
      _exit(3);
    }
    try {
      Database reader(folder / "test.db", SchemaOf(1), Access::kReader);
      _exit(reader.QueryInt64("SELECT sum(id) FROM t") == 7 ? 0 : 1);
    } catch (const std::exception&) {
      _exit(2);
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  std::filesystem::permissions(directory_.path(), perms::owner_all);
  std::filesystem::permissions(folder, perms::owner_all);

  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

// Two processes that add to one row: without the gate and BEGIN IMMEDIATE an
// update would be lost or refused.
TEST_F(DatabaseTest, WritersOfTwoProcessesTakeTurns) {
  constexpr int kRounds = 100;
  {
    Database database(file_, SchemaOf(1), Access::kWriter);
    Insert(database, 1);
    Transaction transaction(database);
    database.Run("UPDATE t SET v = 0");
    transaction.Commit();
  }
  const auto add = [&](Access access) {
    Database database(file_, SchemaOf(1), access);
    for (int i = 0; i < kRounds; ++i) {
      Transaction transaction(database);
      database.Run("UPDATE t SET v = v + 1");
      transaction.Commit();
    }
  };
  const pid_t child = fork();
  if (child == 0) {
    try {
      add(Access::kOccasionalWriter);
      _exit(0);
    } catch (...) {
      _exit(1);
    }
  }
  add(Access::kWriter);
  int status = -1;
  waitpid(child, &status, 0);

  EXPECT_EQ(status, 0);
  Database reader(file_, SchemaOf(1), Access::kReader);
  EXPECT_EQ(reader.QueryInt64("SELECT CAST(v AS INTEGER) FROM t"), 2 * kRounds);
}

TEST(ExclusiveLockTest, SecondHolderIsRefusedWithThePidOfTheFirst) {
  const TemporaryDirectory directory;
  const auto path = directory.path() / "history.db.lock";
  {
    const ExclusiveLock first(path, "monitoring");
    try {
      const ExclusiveLock second(path, "monitoring");
      ADD_FAILURE();
    } catch (const DataError& error) {
      EXPECT_THAT(error.what(), HasSubstr(std::to_string(getpid())));
      EXPECT_THAT(error.what(), HasSubstr("monitoring"));
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
    }
  }
  EXPECT_NO_THROW(ExclusiveLock(path, "monitoring"));
}

}  // namespace
}  // namespace fdi::storage
