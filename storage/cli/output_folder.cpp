#include "storage/cli/output_folder.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>

#include <unistd.h>

#include "diagnosis/error.h"

namespace fdi::cli {

void EnsureFolder(const std::filesystem::path& folder) {
  std::error_code error;
  if (!std::filesystem::is_directory(folder, error)) {
    const std::filesystem::path whole =
        std::filesystem::absolute(folder / "").lexically_normal();
    const std::filesystem::path parent = whole.parent_path().parent_path();
    if (!std::filesystem::is_directory(parent, error)) {
      throw DataError("cannot make folder " + folder.string() +
                      ": there is no folder " + parent.string());
    }
    error.clear();
    std::filesystem::create_directory(folder, error);
    if (error) {
      throw DataError("cannot make folder " + folder.string() + ": " +
                      error.message());
    }
    if (!std::filesystem::is_directory(folder, error)) {
      throw DataError(folder.string() + " is a file, not a folder");
    }
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw DataError("cannot write to folder " + folder.string() + ": " +
                    std::strerror(errno));
  }
}

void WriteFile(const std::filesystem::path& path, std::string_view text) {
  std::filesystem::path part = path;
  part += ".part";
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  std::error_code error;
  if (file) {
    std::filesystem::rename(part, path, error);
  }
  if (!file || error) {
    const std::string reason = error ? error.message() : std::strerror(errno);
    std::filesystem::remove(part, error);
    throw DataError("cannot write " + path.string() + ": " + reason);
  }
}

}  // namespace fdi::cli
