#pragma once

#include <chrono>
#include <filesystem>

namespace fdi::storage {

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
