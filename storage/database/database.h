#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "storage/database/open_files.h"

namespace SQLite {
class Database;
class Statement;
}  // namespace SQLite

namespace fdi::storage {

class WriteGate;

/// Text form of an enumeration in a column, e.g. FlowUnit as "m3/h".
/// Specialised by the code that stores it, with
///
///     static constexpr auto name = FlowUnitName;    // of a value
///     static constexpr auto last = FlowUnit::kTPerHour;
///
/// An enumeration without this is stored as its number.
template <typename Enum>
struct EnumText {};

/// @throws DataError: the file holds a name unknown to this program.
[[noreturn]] void RefuseName(std::string_view name);

/// Lists of names are stored in one column, joined by |: "a|b" is {"a", "b"},
/// and "" is {}.
std::vector<std::string> SplitNames(std::string_view joined);

/// A failed SQLite call on an open database. (Errors in opening a file are
/// DataErrors.)
class SqliteError : public std::runtime_error {
 public:
  SqliteError(int code, const std::string& message);
  /// Extended SQLite result code.
  int code() const { return code_; }
  /// SQLITE_BUSY or SQLITE_LOCKED: another connection is writing.
  bool IsBusy() const;
  /// The values are at fault (a constraint, a trigger, type or size), not the
  /// file: trying again does not help, and other rows can be written.
  bool IsOfValues() const;

 private:
  int code_;
};

/// Use of a file by a connection. SQLite before 3.51.3 may corrupt a WAL
/// database if two connections write or checkpoint at the same moment. So every
/// write transaction holds a lock on `<file>.gate`, and only a kWriter
/// checkpoints, while holding it. (The last connection to close checkpoints,
/// too, under SQLite's own exclusive lock.)
enum class Access {
  kWriter,  ///< The recording service; creates, migrates, checkpoints.
  kOccasionalWriter,  ///< A one-shot command; creates and migrates.
  kReader,            ///< Read-only; the file must have the current version.
};

enum class Synchronous {
  kNormal,  ///< Power loss may lose the last commits; never corrupts.
  kFull,    ///< A commit is durable when it returns.
};

/// Identity and version of a database file. Tables are STRICT.
struct Schema {
  std::string_view kind;           ///< In messages: "run", "model", "history".
  std::int32_t application_id{0};  ///< Marks the file as this kind.
  Synchronous synchronous{Synchronous::kFull};
  /// The SQL scripts from nothing to version `baseline`, and from each version
  /// to the next. Never edit a released one: append.
  std::vector<std::string_view> migrations;
  int baseline{1};
  /// Advice for a file from before the baseline: "import its runs again".
  std::string_view instead{};
  /// Additional queries of Check(): one finding per row, as text.
  std::vector<std::string_view> checks{};

  int version() const {
    return baseline + static_cast<int>(migrations.size()) - 1;
  }
};

/// The file is sound, but not yet what a reader can read: it has an older
/// version, or nothing in it. A writer that opens it brings it up to date.
class OutdatedError : public DataError {
 public:
  using DataError::DataError;
};

/// The disk has no room for opening a database. A database that nobody has open
/// can still be read.
class NoRoomError : public DataError {
 public:
  using DataError::DataError;
};

class Database;

/// Storage class of a column in a row.
enum class ColumnType { kInteger, kReal, kText, kBlob, kNull };

/// A prepared statement. Columns and parameters are typed by the call; columns
/// count from 0. Must not outlive its Database.
class Statement {
 public:
  Statement(Database& database, std::string_view sql);
  ~Statement();
  Statement(Statement&&) noexcept;
  Statement& operator=(Statement&&) noexcept;

  /// Resets, then binds all parameters in order. Accepts integers, enums, bool,
  /// double (NaN becomes NULL), text, std::span<const std::byte>, nullopt and
  /// optionals of these. uint64 is stored as the int64 with the same bits.
  template <typename... Args>
  Statement& Bind(const Args&... args) {
    Reset();
    int index = 0;
    (BindAny(++index, args), ...);
    return *this;
  }

  /// Steps. @returns true if there is a row.
  /// @throws std::logic_error for a write outside a Transaction.
  bool Step();
  /// Runs to completion and resets; for statements without result rows.
  void Run();
  void Reset();

  ColumnType TypeOf(int column) const;
  bool IsNull(int column) const;
  std::int64_t Int64(int column) const;
  int Int(int column) const { return static_cast<int>(Int64(column)); }
  std::uint64_t Uint64(int column) const {
    return static_cast<std::uint64_t>(Int64(column));
  }
  double Double(int column) const;
  std::string Text(int column) const;  ///< Empty for NULL.
  std::vector<std::byte> Blob(int column) const;
  std::optional<std::int64_t> OptionalInt64(int column) const;
  std::optional<double> OptionalDouble(int column) const;
  std::optional<std::string> OptionalText(int column) const;

  /// Reads columns from `first` on into `fields`, by their types. NULL becomes
  /// an empty text, 0, or an empty optional.
  /// @throws DataError for an unknown enumeration name.
  template <typename... Fields>
  void Read(int first, Fields&... fields) const {
    (Get(first++, fields), ...);
  }

  int ColumnCount() const;
  std::string ColumnName(int column) const;

 private:
  template <typename T>
  void Get(int column, std::optional<T>& field) const {
    field.reset();
    if (!IsNull(column)) {
      Get(column, field.emplace());
    }
  }
  void Get(int column, std::string& field) const { field = Text(column); }
  void Get(int column, double& field) const { field = Double(column); }
  void Get(int column, std::vector<std::byte>& field) const {
    field = Blob(column);
  }
  void Get(int column, std::vector<std::string>& names) const {
    names = SplitNames(Text(column));
  }
  template <typename T>
  requires std::is_integral_v<T> || std::is_enum_v<T>
  void Get(int column, T& field) const {
    if constexpr (requires { EnumText<T>::last; }) {
      const std::string text = Text(column);
      for (int i = 0; i <= static_cast<int>(EnumText<T>::last); ++i) {
        if (EnumText<T>::name(static_cast<T>(i)) == text) {
          field = static_cast<T>(i);
          return;
        }
      }
      RefuseName(text);
    } else {
      field = static_cast<T>(Int64(column));
    }
  }

  void BindNull(int index);
  void BindInt64(int index, std::int64_t value);
  void BindDouble(int index, double value);
  void BindText(int index, std::string_view value);
  void BindBlob(int index, std::span<const std::byte> value);

  void BindAny(int index, std::nullopt_t) { BindNull(index); }
  template <typename T>
  void BindAny(int index, const std::optional<T>& value) {
    value ? BindAny(index, *value) : BindNull(index);
  }
  template <typename T>
  void BindAny(int index, const T& value) {
    if constexpr (requires { EnumText<T>::last; }) {
      BindText(index, EnumText<T>::name(value));
    } else if constexpr (std::is_integral_v<T> || std::is_enum_v<T>) {
      BindInt64(index, static_cast<std::int64_t>(value));
    } else if constexpr (std::is_floating_point_v<T>) {
      BindDouble(index, value);
    } else if constexpr (std::is_convertible_v<const T&, std::string_view>) {
      BindText(index, value);
    } else {
      BindBlob(index, value);
    }
  }

  Database* database_;
  std::unique_ptr<SQLite::Statement> statement_;
  bool writes_{false};
};

/// One connection to one of the three databases. Not thread safe: it may be
/// handed over, e.g. to a thread started later, but concurrent use by two
/// threads corrupts its statements.
/// Settings of every connection: foreign_keys, trusted_schema OFF, busy_timeout
/// 5 s, WAL, journal_size_limit 64 MiB, synchronous from the schema.
class Database {
 public:
  /// Opens `path`. Writers create it (not its folder) and migrate it forward in
  /// one transaction, after saving a copy of an older file beside it. A reader
  /// that cannot write to the folder, as SQLite's shared memory needs, because
  /// it may not or because the disk is full, reads a file that nobody has open,
  /// which is one without a WAL, as immutable.
  /// @throws DataError naming file and reason: folder missing, no permission,
  ///   not a database, another application_id, a version that is newer, or
  ///   older than the baseline. @throws OutdatedError for a reader,
  ///   NoRoomError.
  /// @throws SqliteError if SQLite fails otherwise.
  Database(const std::filesystem::path& path, const Schema& schema,
           Access access);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  Statement Prepare(std::string_view sql) { return {*this, sql}; }
  /// The statement with this text, prepared at first use; for repeated queries.
  /// One user at a time, who runs it to completion.
  Statement& Cached(std::string_view sql);
  /// Runs one statement without result rows. Writes need a Transaction.
  template <typename... Args>
  void Run(std::string_view sql, const Args&... args) {
    Prepare(sql).Bind(args...).Run();
  }
  /// First column of the first row, if there is a row and it is not NULL.
  template <typename... Args>
  std::optional<std::int64_t> QueryInt64(std::string_view sql,
                                         const Args&... args) {
    Statement statement = Prepare(sql);
    return statement.Bind(args...).Step() ? statement.OptionalInt64(0)
                                          : std::nullopt;
  }

  std::int64_t LastInsertRowid() const;
  /// Rows changed by the last INSERT, UPDATE or DELETE.
  int Changes() const;
  /// Opens the file of this name again, with its schema if it is new, if the
  /// one that is open was deleted or replaced. Programs that keep a file open
  /// for long call this at least every second, outside any transaction.
  /// Statements from Prepare() must not outlive it. @returns whether it did.
  /// @throws as the constructor; the next call tries again.
  bool Refresh();
  bool InPlace() const { return files_.InPlace(); }
  /// Changes whenever another connection has committed since the last call.
  std::int64_t DataVersion();

  /// Copies the WAL into the file and truncates it. Does not wait for readers
  /// that prevent this: @returns false then. @throws std::logic_error unless
  /// this is a kWriter.
  bool Checkpoint();
  std::uintmax_t WalBytes() const;
  std::uintmax_t FileBytes() const;
  /// Bytes of the pages in use; free pages are reused before the file grows.
  std::uintmax_t UsedBytes();

  /// A consistent copy (VACUUM INTO). @throws DataError if `target` exists or
  ///   cannot be made.
  void BackupTo(const std::filesystem::path& target);
  /// quick_check, foreign_key_check and Schema::checks: one line per finding,
  /// empty if sound.
  std::vector<std::string> Check();

  const std::filesystem::path& path() const { return path_; }
  Access access() const { return access_; }
  bool InTransaction() const;
  int version() const { return version_; }

 private:
  friend class Statement;
  friend class Transaction;

  void Configure(const Schema& schema);
  /// @returns the user_version of the file.
  int CheckIdentity(const Schema& schema);
  void Migrate(const Schema& schema, int from);
  void Execute(const std::string& script);

  std::filesystem::path path_;
  Schema schema_;
  Access access_;
  int version_{0};
  std::unique_ptr<WriteGate> gate_;  // Null for a reader.
  OpenFiles files_;                  // Outlives the connection.
  std::unique_ptr<SQLite::Database> connection_;
  std::map<std::string, Statement, std::less<>> cached_;
};

/// A write transaction: waits for the gate (up to 5 s), then BEGIN IMMEDIATE;
/// rolls back unless committed.
class Transaction {
 public:
  /// @throws SqliteError (IsBusy) if another connection keeps the gate or lock.
  explicit Transaction(Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  /// @throws SqliteError also if the file was deleted or replaced meanwhile, in
  ///   which case nothing is in the file of that name. See Database::Refresh().
  void Commit();

 private:
  Database& database_;
  bool open_{true};
};

/// A read transaction: all queries in its scope see one state of the file. Keep
/// it short, because it blocks checkpoints.
class Snapshot {
 public:
  explicit Snapshot(Database& database);
  ~Snapshot();
  Snapshot(const Snapshot&) = delete;
  Snapshot& operator=(const Snapshot&) = delete;

 private:
  Database& database_;
};

}  // namespace fdi::storage
