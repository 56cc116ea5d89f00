#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fdi::trainer {

/// The files that `pattern` stands for, ascending: `${NAME}` is replaced by the
/// environment variable, `*` in the file's name by anything. A pattern without
/// `*` is returned as it is, whether there is such a file or not.
///
/// @param folder That relative patterns start from.
/// @throws ConfigError if a variable is not set, or nothing matches a `*`.
std::vector<std::filesystem::path> MatchingFiles(
    const std::string& pattern, const std::filesystem::path& folder);

}  // namespace fdi::trainer
