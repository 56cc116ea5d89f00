#include "storage/data_directory.h"

#include <system_error>

#include "diagnosis/error.h"

namespace fdi::storage {

void EnsureExists(const DataDirectory& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory.path, error);
  if (error) {
    throw DataError("data directory " + directory.path.string() +
                    " cannot be made: " + error.message());
  }
}

}  // namespace fdi::storage
