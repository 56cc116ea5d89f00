#include "storage/database.h"

#include <cerrno>
#include <cstring>
#include <utility>

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>
#include <unistd.h>

#include "diagnosis/error.h"
#include "storage/sqlite_call.h"
#include "storage/write_gate.h"

namespace fdi::storage {
namespace {

[[noreturn]] void Refuse(const std::filesystem::path& path,
                         const std::string& reason) {
  throw DataError("database " + path.string() + ": " + reason);
}

/// Names the reason that SQLite would hide behind "unable to open".
void CheckReachable(const std::filesystem::path& path, Access access) {
  std::error_code error;
  const auto folder = path.has_parent_path() ? path.parent_path() : ".";
  if (!std::filesystem::is_directory(folder, error)) {
    Refuse(path, folder.string() +
                     (error ? ": " + error.message() : " is not a directory"));
  }
  if (std::filesystem::is_directory(path, error)) {
    Refuse(path, "is a directory, not a file");
  }
  const bool exists = std::filesystem::exists(path, error);
  if (!exists && access != Access::kReader) {
    return;
  }
  const int mode = access == Access::kReader ? R_OK : R_OK | W_OK;
  if (::access(path.c_str(), mode) != 0) {
    Refuse(path, std::strerror(errno));
  }
}

std::unique_ptr<SQLite::Database> Connect(const std::filesystem::path& path,
                                          Access access) {
  const int flags = access == Access::kReader
                        ? SQLite::OPEN_READONLY
                        : SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE;
  try {
    return std::make_unique<SQLite::Database>(
        path.string(), flags, static_cast<int>(kWritePatience.count()));
  } catch (const SQLite::Exception& error) {
    Refuse(path, error.what());
  }
}

/// The first name like `<file>.v1.backup` that is free.
std::filesystem::path FreeBackupName(const std::filesystem::path& path,
                                     int version) {
  const std::string stem = path.string() + ".v" + std::to_string(version);
  std::string name = stem + ".backup";
  for (int i = 2; std::filesystem::exists(name); ++i) {
    name = stem + "-" + std::to_string(i) + ".backup";
  }
  return name;
}

}  // namespace

SqliteError::SqliteError(int code, const std::string& message)
    : std::runtime_error("SQLite error " + std::to_string(code) + ": " +
                         message),
      code_(code) {}

bool SqliteError::IsDiskProblem() const {
  const int primary = code_ & 0xFF;
  return primary == SQLITE_FULL || primary == SQLITE_IOERR;
}

bool SqliteError::IsBusy() const {
  const int primary = code_ & 0xFF;
  return primary == SQLITE_BUSY || primary == SQLITE_LOCKED;
}

Database::Database(const std::filesystem::path& path, const Schema& schema,
                   Access access)
    : path_(path), access_(access) {
  CheckReachable(path, access);
  if (access != Access::kReader) {
    gate_ = std::make_unique<WriteGate>(path);
  }
  connection_ = Connect(path, access);
  if (access == Access::kReader) {
    version_ = CheckIdentity(schema);
    const int current = static_cast<int>(schema.migrations.size());
    if (version_ < current) {
      Refuse(path_, "version " + std::to_string(version_) + " is older than " +
                        std::to_string(current) +
                        ", the version read here: run `fdi-store migrate`");
    }
    Configure(schema);
    return;
  }
  const GateHolder holder(*gate_, path);
  version_ = CheckIdentity(schema);
  Configure(schema);
  if (version_ < static_cast<int>(schema.migrations.size())) {
    Migrate(schema, version_);
  }
}

Database::~Database() = default;

void Database::Execute(const std::string& script) {
  SqliteCall(script, [&] { connection_->exec(script); });
}

int Database::CheckIdentity(const Schema& schema) {
  std::int64_t id = 0;
  std::int64_t version = 0;
  std::int64_t objects = 0;
  try {
    id = connection_->execAndGet("PRAGMA application_id").getInt64();
    version = connection_->execAndGet("PRAGMA user_version").getInt64();
    objects = connection_->execAndGet("SELECT count(*) FROM sqlite_schema")
                  .getInt64();
  } catch (const SQLite::Exception& error) {
    Refuse(path_, error.what());
  }
  const bool blank = id == 0 && version == 0 && objects == 0;
  if (blank && access_ == Access::kReader) {
    Refuse(path_,
           "is empty: who made it was stopped before it was done; the next "
           "program that writes, or fdi-store migrate, goes on with it");
  }
  if (id != schema.application_id && !blank) {
    Refuse(path_, "is not a " + std::string(schema.kind) +
                      " database: application_id " + std::to_string(id) +
                      " instead of " + std::to_string(schema.application_id));
  }
  const auto accepted = static_cast<std::int64_t>(schema.migrations.size());
  if (version < 0 || version > accepted) {
    Refuse(path_, "version " + std::to_string(version) +
                      " is newer than this program, which accepts up to " +
                      std::to_string(accepted));
  }
  return static_cast<int>(version);
}

void Database::Configure(const Schema& schema) {
  Execute("PRAGMA foreign_keys = ON");
  Execute("PRAGMA trusted_schema = OFF");
  Execute("PRAGMA journal_size_limit = 67108864");
  Execute(schema.synchronous == Synchronous::kFull
              ? "PRAGMA synchronous = FULL"
              : "PRAGMA synchronous = NORMAL");
  if (access_ == Access::kReader) {
    Execute("PRAGMA query_only = ON");
    return;
  }
  const std::string mode = SqliteCall("PRAGMA journal_mode = WAL", [this] {
    return connection_->execAndGet("PRAGMA journal_mode = WAL").getString();
  });
  if (mode != "wal") {
    Refuse(path_, "journal mode stays " + mode + ", WAL is needed");
  }
  if (access_ == Access::kOccasionalWriter) {
    Execute("PRAGMA wal_autocheckpoint = 0");
  } else {
    // What a busy recorder touches in a few commits [KiB, pages of 4 KiB].
    Execute("PRAGMA cache_size = -32768");
    Execute("PRAGMA wal_autocheckpoint = 4000");
  }
}

void Database::Migrate(const Schema& schema, int from) {
  if (from > 0) {
    migration_backup_ = FreeBackupName(path_, from);
    BackupTo(*migration_backup_);
  }
  Execute("BEGIN IMMEDIATE");
  try {
    for (std::size_t v = static_cast<std::size_t>(from);
         v < schema.migrations.size(); ++v) {
      Execute(std::string(schema.migrations[v]));
    }
    const auto version = static_cast<int>(schema.migrations.size());
    Execute("PRAGMA application_id = " + std::to_string(schema.application_id));
    Execute("PRAGMA user_version = " + std::to_string(version));
    if (Prepare("PRAGMA foreign_key_check").Step()) {
      Refuse(path_, "rows without their parent after the migration");
    }
    Execute("COMMIT");
    version_ = version;
  } catch (...) {
    connection_->tryExec("ROLLBACK");
    throw;
  }
}

std::int64_t Database::LastInsertRowid() const {
  return connection_->getLastInsertRowid();
}

int Database::Changes() const {
  return connection_->getChanges();
}

std::int64_t Database::DataVersion() {
  return *QueryInt64("PRAGMA data_version");
}

bool Database::InTransaction() const {
  return sqlite3_get_autocommit(connection_->getHandle()) == 0;
}

}  // namespace fdi::storage
