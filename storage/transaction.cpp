#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include "storage/database.h"
#include "storage/write_gate.h"

namespace fdi::storage {

Transaction::Transaction(Database& database) : database_(database) {
  if (database.gate_ == nullptr) {
    throw std::logic_error(database.path().string() + " is open read only");
  }
  if (!database.gate_->Enter(kWritePatience)) {
    throw SqliteError(SQLITE_BUSY, database.path().string() +
                                       ": another process keeps writing");
  }
  try {
    database.Execute("BEGIN IMMEDIATE");
  } catch (...) {
    database.gate_->Leave();
    throw;
  }
}

Transaction::~Transaction() {
  if (open_) {
    database_.connection_->tryExec("ROLLBACK");
    database_.gate_->Leave();
  }
}

void Transaction::Commit() {
  database_.Execute("COMMIT");
  open_ = false;
  database_.gate_->Leave();
}

Snapshot::Snapshot(Database& database) : database_(database) {
  database.Prepare("BEGIN").Run();
}

Snapshot::~Snapshot() {
  try {
    database_.Prepare("COMMIT").Run();
  } catch (const std::exception&) {
    // A read transaction that cannot end ends with its connection.
  }
}

}  // namespace fdi::storage
