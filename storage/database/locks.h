#pragma once

#include <chrono>
#include <filesystem>
#include <string_view>

namespace fdi::storage {

/// Holds a lock file for as long as it lives, e.g. `history.db.lock` for the
/// one monitor that records there. The kernel frees it if the process dies, so
/// a file that was left behind does not block. The file holds the owner's pid.
class ExclusiveLock {
 public:
  /// @param purpose what the holder does, for the message: "recording faults".
  /// @throws DataError naming the file, `purpose` and the pid of the holder if
  ///   another one holds it; naming path and reason if it cannot be opened.
  ExclusiveLock(const std::filesystem::path& path, std::string_view purpose);
  ~ExclusiveLock();
  ExclusiveLock(ExclusiveLock&& other) noexcept;
  ExclusiveLock& operator=(ExclusiveLock&& other) noexcept;
  ExclusiveLock(const ExclusiveLock&) = delete;
  ExclusiveLock& operator=(const ExclusiveLock&) = delete;

 private:
  int file_{-1};
};

/// How long a connection waits for others that write.
inline constexpr std::chrono::milliseconds kWritePatience{5000};

/// Lets one connection at a time write or checkpoint a database, across
/// processes: a lock on `<database>.gate`. (Not on the database itself: to
/// close a second descriptor of it would drop the locks of SQLite.)
class WriteGate {
 public:
  /// @throws DataError naming the file and the reason.
  explicit WriteGate(const std::filesystem::path& database);
  ~WriteGate();
  WriteGate(const WriteGate&) = delete;
  WriteGate& operator=(const WriteGate&) = delete;

  /// @returns false if it stayed locked for `patience`.
  bool Enter(std::chrono::milliseconds patience);
  void Leave() noexcept;

 private:
  int file_{-1};
};

/// Is in the gate for its life.
class GateHolder {
 public:
  /// @throws SqliteError (IsBusy) after kWritePatience, naming `database`.
  GateHolder(WriteGate& gate, const std::filesystem::path& database);
  ~GateHolder();
  GateHolder(const GateHolder&) = delete;
  GateHolder& operator=(const GateHolder&) = delete;

 private:
  WriteGate& gate_;
};

}  // namespace fdi::storage
