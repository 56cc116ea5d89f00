#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace fdi::storage {

/// The files of a database as they were opened. SQLite does not notice that one
/// was deleted or replaced: what it then writes is in no file that anybody else
/// can open. A copy that overwrites a file in place is not noticed here,
/// either.
///
/// While a database is open its -wal and -shm have second names, hard links
/// `.NAME.INODE-wal` and `.NAME.INODE-shm` with the inode of the database. By
/// them a file that was deleted or replaced gets its name back: nothing is
/// lost, and no other program works with another log meanwhile. A lock on the
/// log tells that somebody has it open; what a killed program left is not used.
/// Where no hard link can be made there are no second names.
class OpenFiles {
 public:
  OpenFiles() = default;
  /// @param database one that was just opened.
  /// @throws SqliteError (IsBusy) if others work with another log.
  explicit OpenFiles(std::filesystem::path database);
  ~OpenFiles();
  OpenFiles(OpenFiles&& other) noexcept { *this = std::move(other); }
  OpenFiles& operator=(OpenFiles&& other) noexcept;
  OpenFiles(const OpenFiles&) = delete;
  OpenFiles& operator=(const OpenFiles&) = delete;

  /// To be called before `database` is opened: gives the log that others have
  /// open its name back.
  static void PutBackLogOf(const std::filesystem::path& database);
  /// Gives each file that lost one of its two names that name back. A file that
  /// took the name of a log keeps `NAME-wal.replaced`.
  void PutBack() const;

  /// True if all are still the files of these names.
  bool InPlace() const { return HasDatabase() && HasLog() && HasGate(); }
  bool HasDatabase() const { return database_ && IdOf("") == database_; }
  /// The -wal and the -shm.
  bool HasLog() const { return Has("-wal", wal_) && Has("-shm", shm_); }
  /// True if our WAL lies beside another database, or none.
  bool LeftWal() const { return wal_ && Has("-wal", wal_) && !HasDatabase(); }

 private:
  /// Device and inode; nothing if there is no such file.
  using Id = std::optional<std::pair<std::uint64_t, std::uint64_t>>;

  static Id IdOf(const std::filesystem::path& path);
  Id IdOf(const char* suffix) const;
  bool Has(const char* suffix, const Id& file) const {
    return !file || IdOf(suffix) == file;
  }
  bool HasGate() const { return Has(".gate", gate_); }
  std::filesystem::path Second(const char* suffix) const;
  bool OthersHaveAnotherLog() const;
  void PutBack(const char* suffix, const Id& file) const;

  std::filesystem::path path_;
  Id database_;
  Id wal_;
  Id shm_;
  Id gate_;
  int log_{-1};  // The -wal, locked.
};

}  // namespace fdi::storage
