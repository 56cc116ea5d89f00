#pragma once

#include <filesystem>
#include <string>

namespace fdi::monitor {

/// Reads a file that holds a secret, of at most 1 MiB.
/// @param option named in error messages, e.g. "--console-users".
/// @throws ConfigError if anybody but owner, root and group can read the file,
///   if anybody but owner and root can change it, or if its owner is neither
///   our user nor root; DataError if it cannot be read.
std::string ReadPrivateFile(const std::filesystem::path& path,
                            const std::string& option);

}  // namespace fdi::monitor
