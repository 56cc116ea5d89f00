#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

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
  int size() const;
  int columns() const;
  /// The column is double precision.
  bool IsReal(int column) const;
  /// Rows that an INSERT, UPDATE or DELETE changed.
  std::int64_t changed() const;
  std::optional<std::string> Text(int row, int column) const;
  /// Of a column that is not NULL.
  std::int64_t Int64(int row, int column) const;
  /// Of a bytea; NULL is empty.
  std::vector<std::byte> Bytes(int row, int column) const;

 private:
  std::unique_ptr<pg_result, void (*)(pg_result*)> result_;
};

/// A connection to the PostgreSQL database that holds the plant's history, in
/// its schema `fdi`. One thread at a time.
class PlantDatabase {
 public:
  using Parameters = std::vector<std::optional<std::string>>;

  /// Connects and compares versions. @param url as libpq takes it, e.g.
  ///   postgresql://user@host/plant; a password is better in ~/.pgpass.
  /// @throws PlantError, also for a schema that is not there or of another
  ///   version than this program's, naming both.
  explicit PlantDatabase(const std::string& url);
  ~PlantDatabase();
  PlantDatabase(PlantDatabase&&) noexcept;

  /// Makes the schema, or brings one of an earlier version to this one, and the
  /// roles fdi_writer and fdi_reader; all or nothing. Twice is once.
  /// @throws PlantError
  static PlantDatabase Init(const std::string& url);

  /// Runs one statement, with parameters $1, $2, ... as text.
  /// @throws PlantError
  PlantRows Run(std::string_view sql, const Parameters& parameters = {});
  /// Runs several statements separated by semicolons.
  void RunScript(std::string_view sql);
  /// COPY `target` FROM STDIN (FORMAT binary) of `bytes`.
  void Copy(const std::string& target, std::string_view bytes);

  /// "plant on db.example": without user and password.
  const std::string& name() const { return name_; }
  /// Tells one plant from another, whatever its address.
  const std::string& plant_id() const { return plant_id_; }

 private:
  struct Unchecked {};
  PlantDatabase(const std::string& url, Unchecked);
  void CheckVersion();
  [[noreturn]] void Fail(const char* reason) const;

  std::unique_ptr<pg_conn, void (*)(pg_conn*)> connection_;
  std::string name_;
  std::string plant_id_;
};

/// What a rule of retention took, or in a dry run would take.
struct PlantPruned {
  std::int64_t deleted{0};
  std::int64_t kept{0};                 ///< Protected, of those that are left.
  std::optional<std::int64_t> from_ns;  ///< Begin of the oldest,
  std::optional<std::int64_t> to_ns;    ///< and of the newest.
};

/// Deletes episodes that ended before `before_ns`, are acknowledged and bear no
/// label, with their events and evidence, 5000 a transaction; for the owner of
/// the schema. @throws PlantError
PlantPruned PrunePlantEpisodes(PlantDatabase& plant, std::int64_t before_ns,
                               bool dry_run);
/// Deletes hours of health that ended before `before_ns`.
PlantPruned PrunePlantHealth(PlantDatabase& plant, std::int64_t before_ns,
                             bool dry_run);

/// BEGIN; rolls back unless committed.
class PlantTransaction {
 public:
  explicit PlantTransaction(PlantDatabase& plant);
  ~PlantTransaction();
  PlantTransaction(const PlantTransaction&) = delete;
  PlantTransaction& operator=(const PlantTransaction&) = delete;
  void Commit();

 private:
  PlantDatabase& plant_;
  bool open_{true};
};

}  // namespace fdi::storage
