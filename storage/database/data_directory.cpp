#include "storage/database/data_directory.h"

#include <system_error>

#include "base/error.h"

namespace fdi::storage {

std::uintmax_t FileBytes(const std::filesystem::path& database) {
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(database, error);
  return error ? 0 : bytes;
}

std::uintmax_t WalBytes(const std::filesystem::path& database) {
  return FileBytes(database.string() + "-wal");
}

void EnsureExists(const DataDirectory& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory.path, error);
  if (error) {
    throw DataError("data directory " + directory.path.string() +
                    " cannot be made: " + error.message());
  }
}

}  // namespace fdi::storage
