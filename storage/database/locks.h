#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace fdi::storage {

/// Holds a lock file for its lifetime, e.g. `history.db.lock` for the one
/// monitor that records there. The kernel releases the lock if the process
/// dies, so a file left behind does not block. The file contains the owner's
/// pid.
class ExclusiveLock {
 public:
  /// @param purpose what the holder does, for messages: "recording faults".
  /// @throws DataError naming the file, `purpose` and the holder's pid if the
  ///   lock is taken; naming path and reason if the file cannot be opened.
  ExclusiveLock(const std::filesystem::path& path, std::string_view purpose);
  ~ExclusiveLock();
  /// The pid of the holder; nothing if the lock is free.
  static std::optional<std::string> HolderOf(const std::filesystem::path& path);
  ExclusiveLock(ExclusiveLock&& other) noexcept;
  ExclusiveLock& operator=(ExclusiveLock&& other) noexcept;
  ExclusiveLock(const ExclusiveLock&) = delete;
  ExclusiveLock& operator=(const ExclusiveLock&) = delete;

 private:
  int file_{-1};
};

/// Time that a connection waits for other writers.
inline constexpr std::chrono::milliseconds kWritePatience{5000};

/// Lets one connection at a time write or checkpoint a database, across
/// processes, by a lock on `<database>.gate`. (Not on the database itself:
/// closing a second descriptor of it would drop SQLite's locks.)
class WriteGate {
 public:
  /// @throws DataError naming the file and the reason.
  explicit WriteGate(const std::filesystem::path& database);
  ~WriteGate();
  WriteGate(const WriteGate&) = delete;
  WriteGate& operator=(const WriteGate&) = delete;

  /// @returns false if the gate stayed locked for `patience`.
  bool Enter(std::chrono::milliseconds patience);
  void Leave() noexcept;

 private:
  int file_{-1};
};

/// Holds the gate for its lifetime.
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
