#include "report/shared_files.h"

#include "base/error.h"

namespace fdi::report {

std::filesystem::path SharedFile(std::string_view name) {
  const std::filesystem::path program =
      std::filesystem::read_symlink("/proc/self/exe");
  const std::filesystem::path wanted =
      std::filesystem::path("share") / "fdi" / name;
  // Searches upwards from the program, so that <prefix>/bin finds
  // <prefix>/share, and a program in the build tree finds the files there.
  std::filesystem::path folder = program.parent_path();
  while (true) {
    std::error_code ignored;
    if (std::filesystem::exists(folder / wanted, ignored)) {
      return folder / wanted;
    }
    if (folder == folder.parent_path()) {
      throw DataError("no " + wanted.string() + " in any folder above " +
                      program.string() + ": is the installation complete?");
    }
    folder = folder.parent_path();
  }
}

}  // namespace fdi::report
