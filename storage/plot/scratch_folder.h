#pragma once

#include <filesystem>

namespace fdi::storage {

/// A folder of its own among the temporary ones; removed in the end with all
/// that is in it.
class ScratchFolder {
 public:
  /// @throws std::system_error
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace fdi::storage
