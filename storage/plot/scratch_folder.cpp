#include "storage/plot/scratch_folder.h"

#include <cerrno>
#include <cstdlib>
#include <string>
#include <system_error>

namespace fdi::storage {

ScratchFolder::ScratchFolder() {
  // mkdtemp() puts letters of its own in place of the last six.
  std::string name =
      (std::filesystem::temp_directory_path() / "fdi-plot-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw std::system_error(errno, std::generic_category(), name);
  }
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace fdi::storage
