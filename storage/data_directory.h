#pragma once

#include <filesystem>

namespace fdi::storage {

/// The folder that holds the three databases (`--data DIR`, env FDI_DATA).
struct DataDirectory {
  std::filesystem::path path{"fdi-data"};

  std::filesystem::path runs() const { return path / "runs.db"; }
  std::filesystem::path models() const { return path / "models.db"; }
  std::filesystem::path history() const { return path / "history.db"; }
};

/// Makes the folder if it is not there; for programs that write.
/// @throws DataError naming the path and the reason.
void EnsureExists(const DataDirectory& directory);

}  // namespace fdi::storage
