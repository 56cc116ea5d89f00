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
};

/// Size of the write-ahead logs [byte]; 0 where there is none. A log grows
/// without end while a reader keeps its transaction open.
struct WalSizes {
  std::uintmax_t runs{0};
  std::uintmax_t models{0};
  std::uintmax_t history{0};
};
/// From any thread, beside those that use the databases.
WalSizes WalSizesOf(const DataDirectory& directory);

/// Makes the folder if it is not there; for programs that write.
/// @throws DataError naming the path and the reason.
void EnsureExists(const DataDirectory& directory);

}  // namespace fdi::storage
