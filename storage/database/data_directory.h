#pragma once

#include <cstdint>
#include <filesystem>

namespace fdi::storage {

/// The folder that holds the three databases (`--data DIR`, env FDI_DATA).
struct DataDirectory {
  std::filesystem::path path{"fdi-data"};

  std::filesystem::path runs() const { return path / "runs.db"; }
  std::filesystem::path models() const { return path / "models.db"; }
  std::filesystem::path history() const { return path / "history.db"; }
  /// Held by the monitor that records into history().
  std::filesystem::path lock() const { return path / "history.db.lock"; }
};

/// Sizes of a database and of its write-ahead log [byte], 0 if the file is
/// missing. Thread safe, and safe beside open connections. The log grows
/// without bound while a reader keeps its transaction open.
std::uintmax_t FileBytes(const std::filesystem::path& database);
std::uintmax_t WalBytes(const std::filesystem::path& database);

/// Creates the folder if it does not exist; for programs that write.
/// @throws DataError naming the path and the reason.
void EnsureExists(const DataDirectory& directory);

}  // namespace fdi::storage
