#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.h"
#include "storage/history/history.h"

struct pg_conn;
struct pg_result;

namespace fdi::storage {

/// PostgreSQL is away, refuses or fails; what() is one line with its reason.
class PlantError : public HistoryAwayError {
 public:
  using HistoryAwayError::HistoryAwayError;
};

/// Rows that a statement returned; NULL is nothing. Columns count from 0.
class PlantRows {
 public:
  explicit PlantRows(pg_result* result);

  /// The statement succeeded, or waits for COPY data.
  bool good() const;
  bool TakesData() const;
  bool IsNull() const;
  int size() const;
  int columns() const;
  /// The column is double precision.
  bool IsReal(int column) const;
  /// Rows that an INSERT, UPDATE or DELETE changed.
  std::int64_t changed() const;
  std::optional<std::string> Text(int row, int column) const;
  /// Reads a column that is not NULL.
  std::int64_t Int64(int row, int column) const;
  /// Reads a bytea; NULL is empty.
  std::vector<std::byte> Bytes(int row, int column) const;

 private:
  std::unique_ptr<pg_result, void (*)(pg_result*)> result_;
};

/// Limits on waiting for a server that nobody here controls. A call beyond its
/// limit, or stopped, throws PlantError, after which the connection is closed.
struct PlantLimits {
  /// For each host of the URL, unless its connect_timeout is shorter.
  std::chrono::milliseconds connect{10'000};
  std::chrono::milliseconds lock{30'000};  ///< For what others have locked.
  /// For the answer to one statement.
  std::chrono::milliseconds statement{120'000};
  std::stop_token stop{};
  /// Gets a line, plant_waits, in a wait that takes longer than kPlantPatience;
  /// may be null.
  LogSink log{};
};
inline constexpr std::chrono::milliseconds kPlantPatience{3000};

/// A connection to the PostgreSQL database that holds the plant's history, in
/// its schema `fdi`. It may lead through a pooler that gives each transaction
/// to another session of the server (PgBouncer's pool_mode = transaction): no
/// setting, temporary table or lock outlives a transaction. One thread at a
/// time.
class PlantDatabase {
 public:
  using Parameters = std::vector<std::optional<std::string>>;

  /// Connects and compares versions. @param url as libpq takes it, e.g.
  ///   postgresql://user@host/plant; a password is better in ~/.pgpass.
  /// @throws PlantError, also for a schema that is not there or of another
  ///   version than this program's, naming both.
  explicit PlantDatabase(const std::string& url, PlantLimits limits = {});
  ~PlantDatabase();
  PlantDatabase(PlantDatabase&&) noexcept;

  /// Makes the schema and the roles fdi_writer and fdi_reader, or brings a
  /// released version of them to this one; all or nothing. Twice is once.
  /// @throws PlantError
  static PlantDatabase Init(const std::string& url, PlantLimits limits = {});

  /// Runs one statement, with parameters $1, $2, ... as text.
  /// @throws PlantError
  PlantRows Run(std::string_view sql, const Parameters& parameters = {});
  /// Likewise, in a transaction of its own that only reads, with `fdi` in the
  /// search path.
  PlantRows Read(std::string_view sql, const Parameters& parameters = {});
  /// Runs several statements separated by semicolons.
  void RunScript(std::string_view sql);
  /// COPY `target` FROM STDIN (FORMAT binary) of `bytes`.
  void Copy(const std::string& target, std::string_view bytes);

  /// "plant on db.example": without user and password.
  const std::string& name() const { return name_; }
  /// Tells one plant from another, whatever its address.
  const std::string& plant_id() const { return plant_id_; }
  const PlantLimits& limits() const { return limits_; }
  void SayTo(LogSink log) { limits_.log = std::move(log); }
  /// All statements together have to be answered by then.
  void FinishBy(std::chrono::steady_clock::time_point end) { finish_by_ = end; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Unchecked {};
  struct Wait;
  PlantDatabase(const std::string& url, PlantLimits limits, Unchecked);
  void Connect(const std::string& url);
  void CheckVersion();
  Wait BeginWait(const char* what, std::chrono::milliseconds limit) const;
  void WaitFor(Wait& wait, short events);
  void Flush(Wait& wait);
  PlantRows TakeResult(Wait& wait);
  PlantRows TakeResults(Wait& wait);
  [[noreturn]] void Fail(const char* reason) const;

  PlantLimits limits_;
  std::optional<Clock::time_point> finish_by_;
  std::unique_ptr<pg_conn, void (*)(pg_conn*)> connection_;
  std::string name_;
  std::string plant_id_;
};

/// The rows deleted by a rule of retention, or to be deleted in a dry run.
struct PlantPruned {
  std::int64_t deleted{0};
  std::int64_t kept{0};                 ///< Protected ones among the remaining.
  std::optional<std::int64_t> from_ns;  ///< Begin of the oldest,
  std::optional<std::int64_t> to_ns;    ///< and of the newest.
};

/// The last sign of life of any monitor; 0: none. @throws PlantError
std::int64_t NewestInPlant(PlantDatabase& plant);
/// Deletes episodes that ended, and arrived, before `before_ns`, are
/// acknowledged and bear no label, with their events and evidence, 5000 a
/// transaction; for the owner of the schema. @throws PlantError
PlantPruned PrunePlantEpisodes(PlantDatabase& plant, std::int64_t before_ns,
                               bool dry_run);
/// Deletes hours of health that ended before `before_ns`.
PlantPruned PrunePlantHealth(PlantDatabase& plant, std::int64_t before_ns,
                             bool dry_run);

/// BEGIN, with the limits of the connection as settings of this transaction;
/// rolls back unless committed.
class PlantTransaction {
 public:
  enum class Kind { kWriting, kReading };
  explicit PlantTransaction(PlantDatabase& plant, Kind kind = Kind::kWriting);
  ~PlantTransaction();
  PlantTransaction(const PlantTransaction&) = delete;
  PlantTransaction& operator=(const PlantTransaction&) = delete;
  void Commit();

 private:
  PlantDatabase& plant_;
  bool open_{true};
};

}  // namespace fdi::storage
