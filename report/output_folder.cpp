#include "report/output_folder.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iostream>
#include <string>
#include <system_error>

#include "base/error.h"

namespace fdi::report {

void WriteOutput(const std::filesystem::path& path,
                 const std::function<void(std::ostream&)>& write) {
  if (path == "-") {
    write(std::cout);
    return;
  }
  std::error_code error;
  // Atomic: readers see either the old file or the complete new one. A pipe or
  // a device must not be replaced, and a link stays one.
  const bool replaces = !std::filesystem::is_other(path, error);
  const std::filesystem::path target =
      replaces && std::filesystem::is_symlink(path, error) &&
              std::filesystem::exists(path, error)
          ? std::filesystem::canonical(path)
          : path;
  std::filesystem::path part = target;
  part += replaces ? ".part" : "";
  const auto discard = [&] {
    if (replaces) {
      std::filesystem::remove(part, error);
    }
  };
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  error.clear();
  try {
    if (file) {
      write(file);
      file.close();
    }
  } catch (...) {
    discard();
    throw;
  }
  if (file && replaces) {
    std::filesystem::rename(part, target, error);
  }
  if (!file || error) {
    const std::string reason = error ? error.message() : std::strerror(errno);
    discard();
    throw DataError("cannot write " + path.string() + ": " + reason);
  }
}

void WriteFile(const std::filesystem::path& path, std::string_view text) {
  WriteOutput(path, [text](std::ostream& file) { file << text; });
}

}  // namespace fdi::report
