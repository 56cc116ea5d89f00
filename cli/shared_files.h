#pragma once

#include <filesystem>
#include <string_view>

namespace fdi::cli {

/// A file or folder that was installed with the programs: share/fdi/`name` in
/// the nearest folder above the running program that has it, so
/// <prefix>/bin/fdi-store finds <prefix>/share/fdi, and programs in the build
/// tree find theirs there.
/// @throws DataError naming where it was looked for.
std::filesystem::path SharedFile(std::string_view name);

}  // namespace fdi::cli
