#include "storage/data_directory.h"

#include <system_error>

#include "diagnosis/error.h"

namespace fdi::storage {
namespace {

std::uintmax_t WalSize(std::filesystem::path database) {
  std::error_code error;
  const std::uintmax_t bytes =
      std::filesystem::file_size(database += "-wal", error);
  return error ? 0 : bytes;
}

}  // namespace

WalSizes WalSizesOf(const DataDirectory& directory) {
  return {WalSize(directory.runs()), WalSize(directory.models()),
          WalSize(directory.history())};
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
