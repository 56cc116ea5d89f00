#pragma once

#include <filesystem>
#include <string>

namespace fdi::monitor {

/// The text of a file that holds a secret, of at most 1 MiB.
/// @param option that names it, for messages: "--console-users".
/// @throws ConfigError if others than the owner, root and the group can read
///   it, or others than the owner and root can change it, or if it is neither
///   the user's that we run as nor root's; DataError if it cannot be read.
std::string ReadPrivateFile(const std::filesystem::path& path,
                            const std::string& option);

}  // namespace fdi::monitor
