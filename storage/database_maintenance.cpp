#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "diagnosis/error.h"
#include "storage/data_directory.h"
#include "storage/database.h"
#include "storage/sqlite_call.h"
#include "storage/write_gate.h"

namespace fdi::storage {

bool Database::Checkpoint() {
  if (access_ != Access::kWriter) {
    throw std::logic_error("only the writer of " + path_.string() +
                           " checkpoints");
  }
  const GateHolder holder(*gate_, path_);
  sqlite3* handle = connection_->getHandle();
  sqlite3_busy_timeout(handle, 0);  // A reader may stay for hours.
  const int code = sqlite3_wal_checkpoint_v2(
      handle, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  sqlite3_busy_timeout(handle, static_cast<int>(kWritePatience.count()));
  if (code == SQLITE_BUSY) {
    return false;
  }
  if (code != SQLITE_OK) {
    throw SqliteError(
        code, connection_->getErrorMsg() + std::string(" in: checkpoint"));
  }
  return true;
}

std::uintmax_t Database::WalBytes() const {
  return storage::WalBytes(path_);
}

std::uintmax_t Database::FileBytes() const {
  return storage::FileBytes(path_);
}

std::uintmax_t Database::UsedBytes() {
  const std::int64_t pages =
      *QueryInt64("PRAGMA page_count") - *QueryInt64("PRAGMA freelist_count");
  return static_cast<std::uintmax_t>(pages * *QueryInt64("PRAGMA page_size"));
}

void Database::BackupTo(const std::filesystem::path& target) {
  if (std::filesystem::exists(target)) {
    throw DataError("database " + path_.string() + ": backup " +
                    target.string() + " exists already");
  }
  // A copy is a write to SQLite: lift the lock of a reader for it.
  const bool reader = access_ == Access::kReader;
  try {
    if (reader) {
      Execute("PRAGMA query_only = OFF");
    }
    SqliteCall("VACUUM INTO", [&] {
      SQLite::Statement statement(*connection_, "VACUUM INTO ?");
      statement.bind(1, target.string());
      statement.exec();
    });
    if (reader) {
      Execute("PRAGMA query_only = ON");
    }
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(target, ignored);
    throw;
  }
}

std::vector<std::string> Database::Check() {
  std::vector<std::string> findings;
  try {
    Statement quick = Prepare("PRAGMA quick_check");
    while (quick.Step()) {
      if (quick.Text(0) != "ok") {
        findings.push_back(quick.Text(0));
      }
    }
    Statement keys = Prepare("PRAGMA foreign_key_check");
    while (keys.Step()) {
      findings.push_back("row " + keys.Text(1) + " of table " + keys.Text(0) +
                         " has no parent in " + keys.Text(2));
    }
  } catch (const SqliteError& error) {
    if ((error.code() & 0xFF) != SQLITE_CORRUPT) {
      throw;
    }
    findings.emplace_back(error.what());
  }
  return findings;
}

}  // namespace fdi::storage
