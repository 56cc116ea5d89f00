#pragma once

#include <filesystem>
#include <string_view>

namespace fdi::report {

/// A file or folder installed with the programs: share/fdi/`name` in the
/// nearest folder above the running program that has it. So
/// <prefix>/bin/fdi-store finds <prefix>/share/fdi, and programs in the build
/// tree find theirs.
/// @throws DataError naming where it was searched for.
std::filesystem::path SharedFile(std::string_view name);

}  // namespace fdi::report
