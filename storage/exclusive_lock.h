#pragma once

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

}  // namespace fdi::storage
