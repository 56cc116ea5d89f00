#include "storage/database/database.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include <SQLiteCpp/SQLiteCpp.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include "base/headroom.h"
#include "base/text.h"
#include "diagnosis/records/valve_glob.h"
#include "storage/database/data_directory.h"
#include "storage/database/locks.h"

namespace fdi::storage {
namespace {

/// Runs `call` and turns what SQLiteCpp throws into a SqliteError that names
/// the operation.
template <typename Call>
auto SqliteCall(std::string_view operation, Call&& call) {
  try {
    return std::forward<Call>(call)();
  } catch (const SQLite::Exception& error) {
    // An error that SQLiteCpp raises itself, such as a wrong column index, has
    // no extended code, which is then -1.
    const int extended = error.getExtendedErrorCode();
    throw SqliteError(
        extended > 0 ? extended : error.getErrorCode(),
        std::string(error.what()) + " in: " + std::string(operation));
  }
}

template <typename Error = DataError>
[[noreturn]] void Refuse(const std::filesystem::path& path,
                         const std::string& reason) {
  // SQLite names other reasons where no descriptor is left.
  const std::string lack = LackOfDescriptors(4);
  throw Error("database " + path.string() + ": " +
              (lack.empty() ? reason : lack));
}

/// Reports the reason that SQLite would hide behind "unable to open".
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
  // SQLite would wait at a FIFO for ever.
  if (exists && !std::filesystem::is_regular_file(path, error)) {
    Refuse(path, "is a device, socket or FIFO, not a file");
  }
  if (!exists && access != Access::kReader) {
    return;
  }
  const int mode = access == Access::kReader ? R_OK : R_OK | W_OK;
  if (::access(path.c_str(), mode) != 0) {
    Refuse(path, std::strerror(errno));
  }
}

// `text GLOB pattern`. SQLite's own differs in sets: only ^ negates them.
void Glob(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  const auto text = [values](int index) -> std::string_view {
    const auto* bytes =
        reinterpret_cast<const char*>(sqlite3_value_text(values[index]));
    return {bytes == nullptr ? "" : bytes,
            static_cast<std::size_t>(sqlite3_value_bytes(values[index]))};
  };
  sqlite3_result_int(context, GlobMatches(text(0), text(1)) ? 1 : 0);
}

std::filesystem::path WalPath(std::filesystem::path database) {
  return database += "-wal";
}

// True if a reader must do without SQLite's shared memory, and can: the file is
// open nowhere, because whoever has it open has a WAL beside it.
bool IsImmutable(const std::filesystem::path& path, Access access) {
  const auto folder = path.has_parent_path() ? path.parent_path() : ".";
  std::error_code error;
  return access == Access::kReader && ::access(folder.c_str(), W_OK) != 0 &&
         !std::filesystem::exists(WalPath(path), error) && !error;
}

// True if SQLite finds the room for its shared memory.
bool HasRoomToRead(SQLite::Database& connection) {
  try {
    connection.execAndGet("PRAGMA user_version");
    return true;
  } catch (const SQLite::Exception& error) {
    return error.getErrorCode() != SQLITE_IOERR &&
           error.getErrorCode() != SQLITE_FULL;
  }
}

// SQLite calls a disk that is full an I/O error.
void RefuseLackOfRoom(const std::filesystem::path& path) {
  // The shared memory of a database (32 KiB) and the first pages of its log.
  constexpr std::uintmax_t kNeeded = 65536;
  const auto folder = path.has_parent_path() ? path.parent_path() : ".";
  std::error_code error;
  const auto room = std::filesystem::space(folder, error);
  if (!error && room.available < kNeeded) {
    Refuse<NoRoomError>(path,
                        "the disk is full: " + std::to_string(room.available) +
                            " bytes are free in " + folder.string());
  }
}

// file:PATH?immutable=1, with the signs escaped that mean something in a URI.
std::string ImmutableUri(const std::filesystem::path& path) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    uri += c == '%'   ? "%25"
           : c == '?' ? "%3f"
           : c == '#' ? "%23"
                      : std::string(1, c);
  }
  return uri + "?immutable=1";
}

std::unique_ptr<SQLite::Database> Connect(const std::filesystem::path& path,
                                          Access access, bool immutable) {
  const int flags = immutable ? SQLite::OPEN_READONLY | SQLite::OPEN_URI
                    : access == Access::kReader
                        ? SQLite::OPEN_READONLY
                        : SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE;
  try {
    auto connection = std::make_unique<SQLite::Database>(
        immutable ? ImmutableUri(path) : path.string(), flags,
        static_cast<int>(kWritePatience.count()));
    connection->createFunction("glob", 2, true, nullptr, Glob);
    return connection;
  } catch (const SQLite::Exception& error) {
    Refuse(path, error.what());
  }
}

/// The first unused name like `<file>.v1.backup`.
std::filesystem::path FreeBackupName(const std::filesystem::path& path,
                                     int version) {
  const std::string stem = path.string() + ".v" + std::to_string(version);
  std::string name = stem + ".backup";
  for (int i = 2; std::filesystem::exists(name); ++i) {
    name = stem + "-" + std::to_string(i) + ".backup";
  }
  return name;
}

// The copy on the way: it gets its name once the migration is committed, so
// that one that is killed and tried again leaves no copy for each attempt.
std::filesystem::path UnfinishedBackup(const std::filesystem::path& path,
                                       int version) {
  return path.string() + ".v" + std::to_string(version) + ".backup.unfinished";
}

// Gives the copies of before the version of the file their names, which a
// program that was killed after its migration had committed did not.
void FinishBackups(const std::filesystem::path& path, int version) {
  for (int before = 1; before < version; ++before) {
    const std::filesystem::path copy = UnfinishedBackup(path, before);
    if (std::filesystem::exists(copy)) {
      std::filesystem::rename(copy, FreeBackupName(path, before));
    }
  }
}

// SQLiteCpp does not expose its statement handle, so it is found by its text;
// of several statements with that text, any gives the answer. SQLite counts
// BEGIN and COMMIT as reading, so a Snapshot can step them, but BEGIN IMMEDIATE
// as writing, so a Transaction executes it past this check.
bool Writes(sqlite3* connection, const std::string& sql) {
  for (sqlite3_stmt* s = sqlite3_next_stmt(connection, nullptr); s != nullptr;
       s = sqlite3_next_stmt(connection, s)) {
    if (sqlite3_sql(s) == sql) {
      return sqlite3_stmt_readonly(s) == 0;
    }
  }
  return false;
}

}  // namespace

void RefuseName(std::string_view name) {
  throw DataError("the database holds an unknown name: " + std::string(name));
}

std::vector<std::string> SplitNames(std::string_view joined) {
  std::vector<std::string> names;
  while (!joined.empty()) {
    const std::size_t bar = std::min(joined.find('|'), joined.size());
    names.emplace_back(joined.substr(0, bar));
    joined.remove_prefix(std::min(bar + 1, joined.size()));
  }
  return names;
}

// A full disk is said in words: its number helps nobody.
SqliteError::SqliteError(int code, const std::string& message)
    : std::runtime_error(
          (code & 0xFF) == SQLITE_FULL
              ? "the disk of the databases is full, or a limit on the size of "
                "files is reached; make room (SQLite: " +
                    message + ")"
              : "SQLite error " + std::to_string(code) + ": " + message),
      code_(code) {}

bool SqliteError::IsBusy() const {
  // The low byte of an extended result code is its primary code.
  const int primary = code_ & 0xFF;
  return primary == SQLITE_BUSY || primary == SQLITE_LOCKED;
}

bool SqliteError::IsOfValues() const {
  const int primary = code_ & 0xFF;
  return primary == SQLITE_CONSTRAINT || primary == SQLITE_MISMATCH ||
         primary == SQLITE_TOOBIG || primary == SQLITE_RANGE;
}

Database::Database(const std::filesystem::path& path, const Schema& schema,
                   Access access)
    : path_(path), schema_(schema), access_(access) {
  CheckReachable(path, access);
  if (access != Access::kReader) {
    gate_ = std::make_unique<WriteGate>(path);
  }
  OpenFiles::PutBackLogOf(path);
  connection_ = Connect(path, access, IsImmutable(path, access));
  if (access == Access::kReader) {
    if (!HasRoomToRead(*connection_) && WalBytes() == 0) {
      connection_ = Connect(path, access, true);
    }
    version_ = CheckIdentity(schema);
    if (version_ < schema.version()) {
      Refuse<OutdatedError>(
          path_, "version " + std::to_string(version_) + " is older than " +
                     std::to_string(schema.version()) +
                     ", the version read here: run `fdi-store doctor`");
    }
    Configure(schema);
  } else {
    // Under the gate, so that two writers that open a new file do not both
    // create it.
    const GateHolder holder(*gate_, path);
    try {
      version_ = CheckIdentity(schema);
      Configure(schema);
      if (version_ < schema.version()) {
        Migrate(schema, version_);
      } else {
        FinishBackups(path_, version_);
      }
    } catch (const SqliteError&) {
      RefuseLackOfRoom(path);
      throw;
    }
  }
  // A connection that has read in WAL mode keeps its WAL until it is closed.
  connection_->execAndGet("PRAGMA user_version");
  files_ = OpenFiles(path);
}

// SQLite deletes its files by name.
Database::~Database() {
  files_.PutBack();
}

bool Database::Refresh() {
  files_.PutBack();
  if (files_.InPlace()) {
    return false;
  }
  if (files_.HasDatabase() && !files_.HasLog()) {
    Refuse(path_,
           "its -wal or -shm was deleted or replaced, and others cannot read "
           "what it held: write nothing here by other programs, and end "
           "those that have the file open");
  }
  // Another database would take our WAL for its own.
  if (files_.LeftWal()) {
    if (access_ == Access::kReader) {
      Refuse(path_,
             "was deleted or replaced, and the -wal beside it is the old one");
    }
    for (const char* suffix : {"-wal", "-shm"}) {
      std::filesystem::path left = path_;
      std::error_code ignored;
      std::filesystem::remove(left += suffix, ignored);
    }
  }
  // SQLite leaves the files of these names alone when it closes one that is no
  // longer in place.
  Database fresh(path_, schema_, access_);
  cached_.clear();  // Before the connection that they belong to.
  std::swap(version_, fresh.version_);
  std::swap(gate_, fresh.gate_);
  std::swap(connection_, fresh.connection_);
  std::swap(files_, fresh.files_);
  return true;
}

void Database::Execute(const std::string& script) {
  SqliteCall(script, [&] { connection_->exec(script); });
}

int Database::CheckIdentity(const Schema& schema) {
  const auto refuse_begun = [this] {
    Refuse<OutdatedError>(
        path_,
        "is empty: who made it was stopped before it was done; the next "
        "program that writes, or `fdi-store doctor`, goes on with it");
  };
  std::int64_t id = 0;
  std::int64_t version = 0;
  std::int64_t objects = 0;
  try {
    id = connection_->execAndGet("PRAGMA application_id").getInt64();
    version = connection_->execAndGet("PRAGMA user_version").getInt64();
    objects = connection_->execAndGet("SELECT count(*) FROM sqlite_schema")
                  .getInt64();
  } catch (const SQLite::Exception& error) {
    // Only a file that is not in WAL mode yet can have left a journal, which a
    // writer has to roll back.
    if (error.getExtendedErrorCode() == SQLITE_READONLY_ROLLBACK) {
      refuse_begun();
    }
    const int code = error.getErrorCode();
    if (access_ == Access::kReader &&
        (code == SQLITE_READONLY || code == SQLITE_CANTOPEN)) {
      Refuse(path_, "reading needs " + path_.filename().string() +
                        "-shm beside it, which cannot be written (" +
                        error.what() +
                        "): read it as a user who may write to its folder, or "
                        "read a copy that fdi-store backup has made");
    }
    RefuseLackOfRoom(path_);
    Refuse(path_, error.what());
  }
  // A program that was stopped before it had committed its first migration
  // leaves an empty database. Tables, application_id and user_version are
  // committed together, so there is nothing between empty and complete.
  const bool blank = id == 0 && version == 0 && objects == 0;
  if (blank && access_ == Access::kReader) {
    refuse_begun();
  }
  if (id != schema.application_id && !blank) {
    Refuse(path_, "is not a " + std::string(schema.kind) +
                      " database: application_id " + std::to_string(id) +
                      " instead of " + std::to_string(schema.application_id));
  }
  if (version > schema.version()) {
    Refuse(path_, "version " + std::to_string(version) +
                      " is newer than this program, which accepts up to " +
                      std::to_string(schema.version()));
  }
  if (version < schema.baseline && !blank) {
    Refuse(path_, "version " + std::to_string(version) +
                      " was never released, and nothing reads it any more: "
                      "move it away and " +
                      std::string(schema.instead));
  }
  return static_cast<int>(version);
}

void Database::Configure(const Schema& schema) {
  // Within a transaction, SQLite ignores foreign_keys and refuses to change to
  // WAL, so both are set before Migrate() begins one. With trusted_schema OFF,
  // the views and triggers of a file from elsewhere cannot call functions that
  // have side effects.
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
  // An automatic checkpoint runs within COMMIT, at which time Transaction still
  // holds the gate; an occasional writer leaves it to the recording service
  // (docs/adr/0004-one-writer.md).
  if (access_ == Access::kOccasionalWriter) {
    Execute("PRAGMA wal_autocheckpoint = 0");
  } else {
    // The pages that a busy recorder touches in a few commits [KiB].
    Execute("PRAGMA cache_size = -32768");
    Execute("PRAGMA wal_autocheckpoint = 4000");
  }
}

void Database::Migrate(const Schema& schema, int from) {
  // VACUUM INTO cannot run inside a transaction: the caller holds the gate, so
  // that nobody writes between the copy and the migration.
  const std::filesystem::path copy = UnfinishedBackup(path_, from);
  if (from > 0) {
    std::filesystem::remove(copy);
    BackupTo(copy);
  }
  // One transaction for all versions. application_id and user_version are in
  // the header of the file and are rolled back with the rest.
  Execute("BEGIN IMMEDIATE");
  try {
    for (auto v = static_cast<std::size_t>(
             from == 0 ? 0 : from - schema.baseline + 1);
         v < schema.migrations.size(); ++v) {
      Execute(std::string(schema.migrations[v]));
    }
    Execute("PRAGMA application_id = " + std::to_string(schema.application_id));
    Execute("PRAGMA user_version = " + std::to_string(schema.version()));
    if (Prepare("PRAGMA foreign_key_check").Step()) {
      Refuse(path_, "rows without their parent after the migration");
    }
    Execute("COMMIT");
    version_ = schema.version();
  } catch (...) {
    connection_->tryExec("ROLLBACK");
    // The file is as before, and a service tries again and again: each attempt
    // would leave a copy of it.
    std::error_code ignored;
    std::filesystem::remove(copy, ignored);
    throw;
  }
  FinishBackups(path_, version_);
}

Statement& Database::Cached(std::string_view sql) {
  auto found = cached_.find(sql);
  if (found == cached_.end()) {
    found = cached_.emplace(sql, Prepare(sql)).first;
  }
  return found->second;
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

bool Database::Checkpoint() {
  if (access_ != Access::kWriter) {
    throw std::logic_error("only the writer of " + path_.string() +
                           " checkpoints");
  }
  const GateHolder holder(*gate_, path_);
  sqlite3* handle = connection_->getHandle();
  sqlite3_busy_timeout(handle, 0);  // A reader may last for hours.
  const int code = sqlite3_wal_checkpoint_v2(
      handle, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  sqlite3_busy_timeout(handle, static_cast<int>(kWritePatience.count()));
  // A reader still needs part of the log. SQLite has copied what it could; the
  // log is truncated by a later call.
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
  // After a deletion the file is as large as before; its free pages are reused.
  // So limits on the size must count the pages in use.
  const std::int64_t pages =
      *QueryInt64("PRAGMA page_count") - *QueryInt64("PRAGMA freelist_count");
  return static_cast<std::uintmax_t>(pages * *QueryInt64("PRAGMA page_size"));
}

void Database::BackupTo(const std::filesystem::path& target) {
  // VACUUM INTO takes an empty file. It is created here, and only here: a copy
  // that fails half-way is removed below, and must not be somebody else's.
  const int file =
      open(target.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file < 0) {
    Refuse(path_, "backup " + target.string() +
                      (errno == EEXIST ? " exists already"
                                       : std::string(" cannot be made: ") +
                                             std::strerror(errno)));
  }
  close(file);
  // VACUUM INTO counts as a write: a reader's query_only is lifted for it.
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
    for (const std::string_view check : schema_.checks) {
      Statement rows = Prepare(check);
      while (rows.Step()) {
        findings.push_back(rows.Text(0));
      }
    }
  } catch (const SqliteError& error) {
    // SQLite reports damage in two ways: as a row of quick_check, or as the
    // error of the statement that meets it.
    if ((error.code() & 0xFF) != SQLITE_CORRUPT) {
      throw;
    }
    findings.emplace_back(error.what());
  }
  return findings;
}

Statement::Statement(Database& database, std::string_view sql)
    : database_(&database) {
  const std::string text(sql);
  SqliteCall(text, [&] {
    statement_ =
        std::make_unique<SQLite::Statement>(*database.connection_, text);
  });
  writes_ = Writes(database.connection_->getHandle(), text);
}

Statement::~Statement() = default;
Statement::Statement(Statement&&) noexcept = default;
Statement& Statement::operator=(Statement&&) noexcept = default;

bool Statement::Step() {
  if (writes_ && !database_->InTransaction()) {
    throw std::logic_error("written outside a transaction: " +
                           statement_->getQuery());
  }
  return SqliteCall(statement_->getQuery(),
                    [this] { return statement_->executeStep(); });
}

void Statement::Run() {
  while (Step()) {
  }
  Reset();
}

void Statement::Reset() {
  // reset() repeats the error of the preceding step(), which is not an error
  // here.
  statement_->tryReset();
}

void Statement::BindNull(int index) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index); });
}

void Statement::BindInt64(int index, std::int64_t value) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index, value); });
}

void Statement::BindDouble(int index, double value) {
  SqliteCall(statement_->getQuery(), [&] { statement_->bind(index, value); });
}

void Statement::BindText(int index, std::string_view value) {
  SqliteCall(statement_->getQuery(),
             [&] { statement_->bind(index, std::string(value)); });
}

void Statement::BindBlob(int index, std::span<const std::byte> value) {
  // A null pointer would bind NULL: an empty blob needs an address.
  const void* data =
      value.empty() ? "" : static_cast<const void*>(value.data());
  SqliteCall(statement_->getQuery(), [&] {
    statement_->bind(index, data, static_cast<int>(value.size()));
  });
}

ColumnType Statement::TypeOf(int column) const {
  switch (statement_->getColumn(column).getType()) {
    case SQLITE_INTEGER:
      return ColumnType::kInteger;
    case SQLITE_FLOAT:
      return ColumnType::kReal;
    case SQLITE_TEXT:
      return ColumnType::kText;
    case SQLITE_BLOB:
      return ColumnType::kBlob;
    default:
      return ColumnType::kNull;
  }
}

bool Statement::IsNull(int column) const {
  return statement_->isColumnNull(column);
}

std::int64_t Statement::Int64(int column) const {
  return statement_->getColumn(column).getInt64();
}

double Statement::Double(int column) const {
  return statement_->getColumn(column).getDouble();
}

std::string Statement::Text(int column) const {
  return statement_->getColumn(column).getString();
}

std::vector<std::byte> Statement::Blob(int column) const {
  const SQLite::Column value = statement_->getColumn(column);
  const auto* data = static_cast<const std::byte*>(value.getBlob());
  return data == nullptr
             ? std::vector<std::byte>{}
             : std::vector<std::byte>(data, data + value.getBytes());
}

std::optional<std::int64_t> Statement::OptionalInt64(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Int64(column));
}

std::optional<double> Statement::OptionalDouble(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Double(column));
}

std::optional<std::string> Statement::OptionalText(int column) const {
  return IsNull(column) ? std::nullopt : std::optional(Text(column));
}

int Statement::ColumnCount() const {
  return statement_->getColumnCount();
}

std::string Statement::ColumnName(int column) const {
  return statement_->getColumnName(column);
}

Transaction::Transaction(Database& database) : database_(database) {
  if (database.gate_ == nullptr) {
    throw std::logic_error(database.path().string() + " is open read only");
  }
  // Every writer takes the gate first, then SQLite's lock. IMMEDIATE takes that
  // lock at the beginning: a transaction that first reads and then writes fails
  // if another connection has committed in between, and no waiting cures that
  // (SQLITE_BUSY_SNAPSHOT). Transactions of one connection do not nest: the
  // gate would let the inner one in, and SQLite refuses it.
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
    // After some errors, e.g. a full disk, SQLite has rolled back by itself and
    // refuses another ROLLBACK, which is harmless.
    database_.connection_->tryExec("ROLLBACK");
    database_.gate_->Leave();
  }
}

void Transaction::Commit() {
  // COMMIT may checkpoint, so the gate is left after it. If it fails, the
  // transaction is still open and the destructor rolls it back.
  database_.Execute("COMMIT");
  open_ = false;
  database_.gate_->Leave();
  database_.files_.PutBack();
  if (!database_.files_.InPlace()) {
    throw SqliteError(SQLITE_READONLY_DBMOVED,
                      database_.path().string() +
                          " was deleted or replaced while it was open: what "
                          "was written is not in the file of this name");
  }
}

Snapshot::Snapshot(Database& database) : database_(database) {
  // BEGIN takes no lock: the state that is seen is that of the first query in
  // the scope. SQLite does not nest transactions, so a Snapshot cannot be
  // opened within another one or within a Transaction.
  database.Prepare("BEGIN").Run();
}

Snapshot::~Snapshot() {
  try {
    database_.Prepare("COMMIT").Run();
  } catch (const std::exception&) {
    // If COMMIT fails, the read transaction ends with its connection.
  }
}

}  // namespace fdi::storage
